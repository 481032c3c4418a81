//! One Unix stream socket per client.

use std::io::{Read, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::PathBuf;
use std::time::Duration;

use tactnet_channel_stress::{Client, Failure, Master};

fn path(name: &str) -> PathBuf {
    std::env::temp_dir().join(format!("{name}.socket"))
}

pub(super) struct UnixMaster {
    listener: UnixListener,
    path: PathBuf,
    clients: Vec<UnixStream>,
    expected: usize,
    packet: Vec<u8>,
    next: usize,
}

impl UnixMaster {
    pub(super) fn open(name: &str, size: usize, clients: usize) -> Result<Self, Failure> {
        let path = path(name);
        let _ = std::fs::remove_file(&path);
        Ok(Self {
            listener: UnixListener::bind(&path)?,
            path,
            clients: Vec::new(),
            expected: clients,
            packet: vec![0; size],
            next: 0,
        })
    }
}

impl Drop for UnixMaster {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.path);
    }
}

impl Master for UnixMaster {
    fn broadcast(&mut self, round: u32) -> Result<(), Failure> {
        while self.clients.len() < self.expected {
            self.clients.push(self.listener.accept()?.0);
        }
        self.next = 0;
        self.packet[..4].copy_from_slice(&round.to_le_bytes());
        for client in &mut self.clients {
            client.write_all(&self.packet)?;
        }
        Ok(())
    }

    fn answer(&mut self, patience: Duration) -> Result<Option<u32>, Failure> {
        let client = &mut self.clients[self.next];
        self.next += 1;
        client.set_read_timeout(Some(patience))?;
        client.read_exact(&mut self.packet)?;
        Ok(Some(first_word(&self.packet)))
    }
}

pub(super) struct UnixClient {
    stream: UnixStream,
    packet: Vec<u8>,
}

impl UnixClient {
    pub(super) fn open(name: &str, size: usize) -> Result<Self, Failure> {
        Ok(Self {
            stream: UnixStream::connect(path(name))?,
            packet: vec![0; size],
        })
    }
}

impl Client for UnixClient {
    fn round(&mut self, patience: Duration) -> Result<Option<u32>, Failure> {
        self.stream.set_read_timeout(Some(patience))?;
        self.stream.read_exact(&mut self.packet)?;
        Ok(Some(first_word(&self.packet)))
    }

    fn answer(&mut self, _: u32) -> Result<(), Failure> {
        Ok(self.stream.write_all(&self.packet)?)
    }
}

fn first_word(packet: &[u8]) -> u32 {
    u32::from_le_bytes([packet[0], packet[1], packet[2], packet[3]])
}
