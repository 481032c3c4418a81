"""Base class of the packets in ``tactnet.packets``."""

from __future__ import annotations

from dataclasses import fields
from typing import Any, Callable, ClassVar, TypeVar

import numpy as np

T = TypeVar("T", bound="Packet")


class Packet:
    """A packet: a dataclass with the same bytes as in Rust and C.

    Arrays with a count of valid values hold only these values; packing sets the count.

    Arrays of texts and of parts are lists, those of numbers NumPy arrays.

    A packet of :meth:`tactnet.channel.GetPort.get` has two more attributes: ``sender``, the random number of its put-port, and ``put_ns``, the
    time of the put in nanoseconds of the sending host's monotonic clock (``time.monotonic_ns``).
    """

    NAME: ClassVar[str]
    VERSION: ClassVar[int]
    DTYPE: ClassVar[np.dtype]
    COUNTED_BY: ClassVar[dict[str, str]]
    PARTS: ClassVar[dict[str, type[Packet]]] = {}

    def received(self: T, sender: int, put_ns: int) -> T:
        """Returns this packet with ``sender`` and ``put_ns`` as attributes, unless it has fields of these names."""
        own = {field.name for field in fields(self)}  # type: ignore[arg-type]
        self.__dict__.update({name: value for name, value in (("sender", sender), ("put_ns", put_ns)) if name not in own})
        return self

    def to_bytes(self) -> bytes:
        """Returns the bytes of the packet; raises ``ValueError`` for values out of range."""
        record = np.zeros((), self.DTYPE)
        self._write(record)
        return record.tobytes()

    def _write(self, record: np.ndarray) -> None:
        counts: dict[str, int] = {}
        for field in fields(self):  # type: ignore[arg-type]
            name, value = field.name, getattr(self, field.name)
            kind = self.DTYPE[name]
            if isinstance(value, Packet):
                value._write(record[name])
            elif kind.shape:
                values = value if kind.base.kind in "SV" else np.asarray(value)
                found, most = len(values), kind.shape[0]
                if found > most:
                    raise ValueError(f"{type(self).__name__}.{name}: expected at most {most} values, found {found}")
                if kind.base.kind in "SV":
                    _fill(record[name], values, kind.base)
                elif found:
                    record[name][:found] = values
                count = self.COUNTED_BY.get(name)
                if count:
                    counts.setdefault(count, found)
            elif kind.kind == "S":
                record[name] = _packed(value, kind)
            elif kind.kind in "iu":
                limits = np.iinfo(kind)
                if not limits.min <= int(value) <= limits.max:
                    raise ValueError(f"{type(self).__name__}.{name}: expected {limits.min} to {limits.max}, found {value}")
                record[name] = int(value)
            else:
                record[name] = value
        for name, count in counts.items():
            record[name] = count

    @classmethod
    def from_bytes(cls: type[T], data: Any) -> T:
        """Returns the packet of ``data``; raises ``ValueError`` for a wrong number of bytes."""
        data = memoryview(data).cast("B")
        if data.nbytes != cls.DTYPE.itemsize:
            raise ValueError(f"{cls.__name__}: expected {cls.DTYPE.itemsize} bytes, found {data.nbytes}")
        return cls._read(np.frombuffer(data, cls.DTYPE)[0])

    @classmethod
    def _read(cls: type[T], record: Any) -> T:
        values: dict[str, Any] = {}
        for field in fields(cls):  # type: ignore[arg-type]
            name = field.name
            kind, value = cls.DTYPE[name], record[name]
            if kind.shape:
                count = cls.COUNTED_BY.get(name)
                value = value[: int(record[count])] if count else value
                if kind.base.kind in "SV":
                    values[name] = _each(value, _text if kind.base.kind == "S" else cls.PARTS[name]._read)
                else:
                    values[name] = value.copy()
            elif kind.kind == "S":
                values[name] = _text(value)
            elif kind.kind == "V":
                values[name] = _part(cls, name)._read(value)
            else:
                values[name] = value.item()
        return cls(**values)


def _fill(into: np.ndarray, values: Any, base: np.dtype) -> None:
    """Writes texts or parts, in lists for more than one dimension, into the beginning of an array."""
    if len(values) > len(into):
        raise ValueError(f"expected at most {len(into)} values, found {len(values)}")
    for at, value in enumerate(values):
        if into.ndim > 1:
            _fill(into[at], value, base)
        elif base.kind == "S":
            into[at] = _packed(value, base)
        else:
            value._write(into[at])


def _each(values: np.ndarray, read: Callable[[Any], Any]) -> list[Any]:
    """Returns the values of an array, in lists for more than one dimension."""
    return [_each(value, read) if values.ndim > 1 else read(value) for value in values]


def _packed(text: str, kind: np.dtype) -> bytes:
    data = text.encode()
    if len(data) > kind.itemsize:
        raise ValueError(f"expected a text of at most {kind.itemsize} bytes, found {len(data)}: {text[:20]}…")
    return data


def _text(data: bytes) -> str:
    try:
        return bytes(data).split(b"\0", 1)[0].decode()
    except UnicodeDecodeError:
        return ""


def _part(of: type, name: str) -> type[Packet]:
    for field in fields(of):
        if field.name == name:
            return field.default_factory  # type: ignore[return-value]
    raise KeyError(name)
