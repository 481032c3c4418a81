//! Waiting for several channels at once.

use std::sync::Arc;
use std::time::Instant;

use crate::get::GetInner;
use crate::wake_event::{FutexWait, MAX_AT_ONCE, WakeEvent};
use crate::{ChannelError, GetSide, Wait};

/// Get-ports that are waited for together (section 2.2 of the thesis). It does not take packets: get them from the
/// port that [`SyncGroup::wait`] names.
#[derive(Debug)]
pub struct SyncGroup {
    ports: Vec<Arc<GetInner>>,
    waits: Vec<FutexWait>,
    /// First port to check in the next round, so that a busy port does not starve the others.
    first: usize,
    crowd: Arc<WakeEvent>,
}

impl SyncGroup {
    pub(crate) fn new(ports: &[&dyn GetSide], crowd: Arc<WakeEvent>) -> Result<Self, ChannelError> {
        if ports.is_empty() {
            return Err(ChannelError::EmptyGroup);
        }
        let ports: Vec<Arc<GetInner>> = ports.iter().map(|port| port.inner()).collect();
        if ports.len() > MAX_AT_ONCE {
            if ports.iter().any(|port| !Arc::ptr_eq(&port.crowd, &crowd)) {
                return Err(ChannelError::MixedGroup { most: MAX_AT_ONCE });
            }
            // Putters must notify the crowd's wake event from now on; otherwise a packet between check and sleep would
            // be missed.
            crowd.attend();
        }
        Ok(Self {
            waits: vec![FutexWait::default(); ports.len()],
            ports,
            first: 0,
            crowd,
        })
    }

    /// Returns the port of the highest priority that has a packet; ports of equal priority take turns.
    fn most_urgent(&self) -> Result<Option<usize>, ChannelError> {
        let highest = self.ports.iter().map(|port| port.priority()).max();
        let mut found: Option<usize> = None;
        for step in 0..self.ports.len() {
            let number = (self.first + step) % self.ports.len();
            let priority = self.ports[number].priority();
            let is_more_urgent = found.is_none_or(|found| self.ports[found].priority() < priority);
            if is_more_urgent && self.ports[number].has_packets()? {
                found = Some(number);
                if Some(priority) == highest {
                    break;
                }
            }
        }
        Ok(found)
    }

    /// Waits until a port has a packet. Returns its index in the group, or `None` after the timeout.
    ///
    /// If several have one, names that of the highest priority; ports of equal priority take turns.
    ///
    /// # Errors
    /// The transport has failed.
    ///
    /// ```
    /// # use std::time::Duration;
    /// # use tactnet_channel::{Bus, ChannelConfig, Domain, Start, Table, Wait};
    /// # let table = Table::new("lab").with("left", ChannelConfig::of::<f32>(1));
    /// # let bus = Bus::open(Domain::Process, &table)?;
    /// let left = bus.get_port::<f32>("left", Start::Now)?;
    /// let mut group = bus.sync_group(&[&left])?;
    /// assert_eq!(group.wait(Wait::Block { timeout: Duration::from_millis(1) })?, None);
    /// # Ok::<_, tactnet_channel::ChannelError>(())
    /// ```
    pub fn wait(&mut self, wait: Wait) -> Result<Option<usize>, ChannelError> {
        let deadline = wait.deadline();
        let ports = self.ports.len();
        loop {
            let crowd = self.crowd.notifications();
            for (wait, port) in self.waits.iter_mut().zip(&self.ports) {
                *wait = port.wake_event.wait();
            }
            if let Some(number) = self.most_urgent()? {
                self.first = (number + 1) % ports;
                return Ok(Some(number));
            }
            match deadline {
                None => std::hint::spin_loop(),
                Some(deadline) if Instant::now() >= deadline => return Ok(None),
                Some(deadline) if ports <= MAX_AT_ONCE => {
                    let wake_events = self.ports.iter().map(|port| &*port.wake_event);
                    WakeEvent::sleep_on_all(wake_events, &self.waits, deadline);
                }
                Some(deadline) => self.crowd.sleep(crowd, deadline),
            }
        }
    }
}

impl Drop for SyncGroup {
    fn drop(&mut self) {
        if self.ports.len() > MAX_AT_ONCE {
            self.crowd.leave();
        }
    }
}
