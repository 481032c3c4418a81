//! The robot's channels: frames, commands and beliefs.

use std::path::PathBuf;
use std::sync::Mutex;

use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use tactnet_channel::{
    ChannelConfig, Domain, GetPort, HubThread, PacketType, Priority, PutPort, Start, Table, now_ns,
    remove_bus,
};
use tactnet_skin::ServeConfig;
use tactnet_skin::packets::{
    Command, MAX_TAXELS, ModelNames, SkinFrame, SweepCommand, TactileBelief, Text,
};

use crate::error::{TactnetError, raised};
use crate::of_process::OfProcess;
use crate::packet_ports::{RawGetPort, RawPutPort, locked, wait_for};
use crate::words::belief_in_words;

/// Holds a bus in this process, for tests and small setups. On a robot the hub is a separate program.
#[pyclass(frozen, module = "tactnet.channel")]
pub(crate) struct Hub {
    thread: OfProcess<Option<HubThread>>,
    table: Table,
}

#[pymethods]
impl Hub {
    /// Starts a hub.
    ///
    /// - `table`: file with the table of channels; None: the default channels of one finger
    /// - `bus`: name of the bus, without a file
    #[new]
    #[pyo3(signature = (table=None, bus="tactnet"))]
    fn new(py: Python<'_>, table: Option<PathBuf>, bus: &str) -> PyResult<Self> {
        let table = match table {
            Some(path) => Table::load(&path).map_err(raised)?,
            None => ServeConfig::default().table(bus),
        };
        let thread = py
            .detach(|| tactnet_channel::Hub::spawn(&table))
            .map_err(raised)?;
        Ok(Self {
            thread: OfProcess::new(Some(thread)),
            table,
        })
    }

    /// Stops the hub and removes its bus; open ports keep their memory.
    fn stop(&self, py: Python<'_>) -> PyResult<()> {
        let thread = self.thread.here()?;
        py.detach(|| {
            let Some(thread) = locked(thread).take() else {
                return Ok(());
            };
            thread.stop()?;
            remove_bus(&self.table).map(drop)
        })
        .map_err(raised)
    }

    /// Table of channels as TOML.
    #[getter]
    fn table(&self) -> String {
        self.table.to_toml()
    }

    fn __enter__(this: Py<Self>) -> Py<Self> {
        this
    }

    #[pyo3(signature = (*_exception))]
    fn __exit__(
        &self,
        py: Python<'_>,
        _exception: &Bound<'_, pyo3::types::PyTuple>,
    ) -> PyResult<()> {
        self.stop(py)
    }
}

/// Access to the channels of a table.
#[pyclass(frozen, module = "tactnet.channel")]
pub(crate) struct Bus {
    bus: OfProcess<tactnet_channel::Bus>,
    table: Table,
    config: ServeConfig,
}

#[pymethods]
impl Bus {
    /// Opens a bus that a hub holds.
    ///
    /// - `table`: the hub's file, or its text as TOML
    #[new]
    fn new(py: Python<'_>, table: &str) -> PyResult<Self> {
        let table = if table.contains('\n') {
            Table::parse(table)
        } else {
            Table::load(table.as_ref())
        }
        .map_err(raised)?;
        let config = ServeConfig::of(&table).map_err(raised)?;
        let bus = py
            .detach(|| tactnet_channel::Bus::open(Domain::Host, &table))
            .map_err(raised)?;
        Ok(Self {
            bus: OfProcess::new(bus),
            table,
            config,
        })
    }

    /// Ids of the channels of skin frames, indexed by finger.
    #[getter]
    fn fingers(&self) -> Vec<String> {
        self.config.fingers.clone()
    }

    /// Returns a port that puts the frames of one finger.
    #[pyo3(signature = (finger=0))]
    fn skin(&self, finger: usize) -> PyResult<SkinPort> {
        let port = locked(self.bus.here()?)
            .put_port(self.finger(finger)?, Priority::High)
            .map_err(raised)?;
        Ok(SkinPort {
            port: OfProcess::new(port),
            sequence: Mutex::new(0),
        })
    }

    /// Returns a port that puts sweep commands.
    fn commands(&self) -> PyResult<CommandPort> {
        let port = locked(self.bus.here()?)
            .put_port(self.config.command.as_str(), Priority::High)
            .map_err(raised)?;
        Ok(CommandPort {
            port: OfProcess::new(port),
        })
    }

    /// Returns a port that puts packets of a type into any channel.
    ///
    /// - `priority`: `bulk`, `normal`, `high` or `real-time`; None: the table's for this channel
    #[pyo3(signature = (channel, name, version, item_bytes, priority=None))]
    fn put_port(
        &self,
        channel: &str,
        name: &str,
        version: u32,
        item_bytes: usize,
        priority: Option<&str>,
    ) -> PyResult<RawPutPort> {
        let packet = packet_type(name, version, item_bytes)?;
        let bus = locked(self.bus.here()?);
        let priority = match priority {
            Some(text) => parse_priority(text)?,
            None => bus.config(channel).map_err(raised)?.priority,
        };
        let port = bus.put_port_of(channel, packet, priority).map_err(raised)?;
        Ok(RawPutPort {
            port: OfProcess::new(port),
            item_bytes,
        })
    }

    /// Returns a port that gets packets of a type from any channel, first the last `history` ones of every sender.
    fn get_port(
        &self,
        channel: &str,
        name: &str,
        version: u32,
        item_bytes: usize,
        history: usize,
    ) -> PyResult<RawGetPort> {
        let packet = packet_type(name, version, item_bytes)?;
        let start = if history == 0 {
            Start::Now
        } else {
            Start::History(history)
        };
        let port = locked(self.bus.here()?)
            .get_port_of(channel, packet, start)
            .map_err(raised)?;
        Ok(RawGetPort {
            table: self.table.clone(),
            port: OfProcess::new(port),
        })
    }

    /// Creates a channel that is not in the table, for as long as the bus exists.
    #[pyo3(signature = (channel, name, version, item_bytes, *, items=1, depth=16, put_ports=1, get_ports=8, history=0))]
    #[allow(clippy::too_many_arguments, reason = "keyword arguments of Python")]
    fn create_channel(
        &self,
        channel: &str,
        name: &str,
        version: u32,
        item_bytes: usize,
        items: usize,
        depth: usize,
        put_ports: usize,
        get_ports: usize,
        history: usize,
    ) -> PyResult<()> {
        let packet = packet_type(name, version, item_bytes)?;
        let config = ChannelConfig {
            packet: packet.name.into(),
            version,
            item_bytes,
            items,
            depth,
            put_ports,
            get_ports,
            history,
            ..ChannelConfig::of::<u8>(1)
        };
        let created = locked(self.bus.here()?).create_channel(channel, config);
        created.map(drop).map_err(raised)
    }

    /// Returns a port that gets beliefs.
    fn beliefs(&self) -> PyResult<BeliefPort> {
        let bus = locked(self.bus.here()?);
        let beliefs = bus
            .get_port(self.config.belief.as_str(), Start::Now)
            .map_err(raised)?;
        let models = bus
            .get_port(self.config.model.as_str(), Start::History(1))
            .map_err(raised)?;
        Ok(BeliefPort {
            table: self.table.clone(),
            inner: OfProcess::new(Beliefs {
                beliefs,
                models,
                names: None,
            }),
        })
    }
}

fn parse_priority(text: &str) -> PyResult<Priority> {
    match text {
        "bulk" => Ok(Priority::Bulk),
        "normal" => Ok(Priority::Normal),
        "high" => Ok(Priority::High),
        "real-time" => Ok(Priority::RealTime),
        other => Err(TactnetError::new_err(format!(
            "priority: expected `bulk`, `normal`, `high` or `real-time`, found `{other}`"
        ))),
    }
}

fn packet_type(name: &str, version: u32, item_bytes: usize) -> PyResult<PacketType<'_>> {
    if item_bytes == 0 {
        return Err(TactnetError::new_err(
            "packet: expected items of at least 1 byte",
        ));
    }
    Ok(PacketType {
        name,
        version,
        item_bytes,
    })
}

impl Bus {
    fn finger(&self, finger: usize) -> PyResult<&str> {
        let names = &self.config.fingers;
        names.get(finger).map(String::as_str).ok_or_else(|| {
            TactnetError::new_err(format!(
                "finger: expected a number below {}, found {finger}",
                names.len()
            ))
        })
    }
}

/// Puts the frames of one finger.
#[pyclass(frozen, module = "tactnet.channel")]
pub(crate) struct SkinPort {
    port: OfProcess<PutPort<SkinFrame>>,
    sequence: Mutex<u64>,
}

#[pymethods]
impl SkinPort {
    /// Puts a frame, written in place in shared memory.
    ///
    /// - `digits`: `[taxels]`, row-major
    /// - `sequence`: number of the frame; None: one more than the last
    /// - `sensor_time_ns`: time of the measurement by the sensor's clock; None: now
    #[pyo3(signature = (digits, sequence=None, sensor_time_ns=None))]
    fn put(
        &self,
        digits: PyReadonlyArray1<'_, f32>,
        sequence: Option<u64>,
        sensor_time_ns: Option<u64>,
    ) -> PyResult<()> {
        let values = digits.as_slice()?;
        if values.is_empty() || values.len() > MAX_TAXELS {
            let found = values.len();
            return Err(TactnetError::new_err(format!(
                "frame: expected 1 to {MAX_TAXELS} taxels, found {found}"
            )));
        }
        let port = self.port.here()?;
        let mut next = locked(&self.sequence);
        let sequence = sequence.unwrap_or(*next);
        let port = locked(port);
        let mut packet = port.loan(1).map_err(raised)?;
        let frame = &mut packet[0];
        frame.sequence = sequence;
        frame.sensor_time_ns = sensor_time_ns.unwrap_or_else(now_ns);
        frame.taxels = values.len() as u32;
        frame.reserved = 0;
        frame.digits[..values.len()].copy_from_slice(values);
        frame.digits[values.len()..].fill(0.0);
        port.put(packet).map_err(raised)?;
        *next = sequence + 1;
        Ok(())
    }
}

/// Puts sweep commands.
#[pyclass(frozen, module = "tactnet.channel")]
pub(crate) struct CommandPort {
    port: OfProcess<PutPort<SweepCommand>>,
}

#[pymethods]
impl CommandPort {
    /// Puts a command.
    ///
    /// - `kind`: "start", "stop", "reset", "enroll" or "adapt"
    #[pyo3(signature = (kind, finger=0, motion=0, sweeps=0, material=""))]
    fn put(
        &self,
        kind: &str,
        finger: u32,
        motion: u64,
        sweeps: u32,
        material: &str,
    ) -> PyResult<()> {
        let command = match kind {
            "start" => Command::Start,
            "stop" => Command::Stop,
            "reset" => Command::Reset,
            "enroll" => Command::Enroll,
            "adapt" => Command::Adapt,
            other => {
                return Err(TactnetError::new_err(format!(
                    "kind: expected start, stop, reset, enroll or adapt, found {other}"
                )));
            }
        };
        let text = Text::new(material);
        let room = size_of_val(&text);
        if material.len() > room {
            return Err(TactnetError::new_err(format!(
                "material: expected a text of at most {room} bytes, found {}: {material:.20}…",
                material.len()
            )));
        }
        let packet = SweepCommand {
            kind: command as u32,
            finger,
            motion,
            sweeps,
            reserved: 0,
            material: text,
        };
        locked(self.port.here()?)
            .put_copy(&[packet])
            .map(drop)
            .map_err(raised)
    }
}

struct Beliefs {
    beliefs: GetPort<TactileBelief>,
    models: GetPort<ModelNames>,
    names: Option<ModelNames>,
}

/// Gets beliefs.
#[pyclass(frozen, module = "tactnet.channel")]
pub(crate) struct BeliefPort {
    inner: OfProcess<Beliefs>,
    table: Table,
}

#[pymethods]
impl BeliefPort {
    /// Waits for the next belief. Returns it as a JSON document, or None after `timeout` seconds.
    #[pyo3(signature = (timeout=None))]
    fn get_json(&self, py: Python<'_>, timeout: Option<f64>) -> PyResult<Option<String>> {
        let inner = self.inner.here()?;
        let belief = wait_for(py, &self.table, timeout, |wait| {
            let mut inner = locked(inner);
            let belief = inner.beliefs.get(wait)?;
            let belief = belief.map(|belief| (belief[0], *belief.header()));
            while let Some(model) = inner.models.try_get()? {
                inner.names = Some(model[0]);
            }
            Ok(belief.and_then(|(belief, header)| {
                let names = inner
                    .names
                    .as_ref()
                    .filter(|names| names.version == belief.model_version);
                let mut words = belief_in_words(&belief, names)?;
                let object = words.as_object_mut()?;
                object.insert("sender".into(), header.sender.into());
                object.insert("put_ns".into(), header.put_ns.into());
                Some(words)
            }))
        })?;
        Ok(belief.map(|belief| belief.to_string()))
    }

    /// Number of lost packets.
    #[getter]
    fn lost(&self) -> PyResult<u64> {
        Ok(locked(self.inner.here()?).beliefs.lost())
    }
}
