"""Progress of a training, as a bar or as lines."""

from __future__ import annotations

from typing import Any


def progress_of(name: str) -> Any:
    """Returns a function for the reports of a training, with ``close``: a bar of tqdm, in notebooks as well, or lines without tqdm."""
    try:
        from tqdm.auto import tqdm
    except ImportError:
        return Lines()
    return Bar(tqdm, name)


class Bar:
    """A bar of batches with a total. The networks of a committee follow one another on it."""

    def __init__(self, tqdm: Any, name: str):
        self._tqdm, self._name = tqdm, name
        self._bar: Any = None

    def __call__(self, epoch: int, batch: int, batches: int, epochs: int, loss: float | None, accuracy: float | None) -> None:
        if self._bar is None:
            self._bar = self._tqdm(total=batches * epochs, desc=self._name, unit="batch")
        elif epoch == batch == 0:
            self._bar.reset(total=batches * epochs)
        if loss is not None:
            self._bar.set_postfix(epoch=f"{epoch + 1}/{epochs}", loss=f"{loss:.3f}", accuracy=f"{accuracy:.3f}", refresh=False)
        self._bar.update()

    def close(self) -> None:
        """Leaves the bar as it is, complete or not."""
        if self._bar is not None:
            self._bar.close()


class Lines:
    """A line for each epoch."""

    def __call__(self, epoch: int, batch: int, batches: int, epochs: int, loss: float | None, accuracy: float | None) -> None:
        if batch + 1 == batches:
            print(f"epoch {epoch + 1}/{epochs}: loss {loss:.3f}, training accuracy {accuracy:.3f}", flush=True)
