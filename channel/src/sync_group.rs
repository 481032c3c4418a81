//! Waiting for any of several channels.

use std::sync::Arc;
use std::time::Instant;

use crate::get::GetInner;
use crate::wake_event::{FutexWait, MAX_AT_ONCE, WakeEvent};
use crate::{ChannelError, GetSide, Wait};

/// Get-ports that are waited for together (thesis, section 2.2). It does not take packets; that is done with the port it names.
#[derive(Debug)]
pub struct SyncGroup {
    ports: Vec<Arc<GetInner>>,
    waits: Vec<FutexWait>,
    /// The port to look at first, so that a busy one does not starve the others.
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
            // Putters must count up from now on, or a packet between look and sleep would go unnoticed.
            crowd.attend();
        }
        Ok(Self {
            waits: vec![FutexWait::default(); ports.len()],
            ports,
            first: 0,
            crowd,
        })
    }

    /// The number of a port that has a packet, in the order they were named; `None` after the timeout.
    ///
    /// # Errors
    /// The transport has broken down.
    pub fn wait(&mut self, wait: Wait) -> Result<Option<usize>, ChannelError> {
        let deadline = wait.deadline();
        let ports = self.ports.len();
        loop {
            let crowd = self.crowd.notifications();
            for (wait, port) in self.waits.iter_mut().zip(&self.ports) {
                *wait = port.wake_event.wait();
            }
            for step in 0..ports {
                let number = (self.first + step) % ports;
                if self.ports[number].has_packets()? {
                    self.first = (number + 1) % ports;
                    return Ok(Some(number));
                }
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
