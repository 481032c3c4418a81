//! Packets of put-ports that closed before a get-port had connected to them.
//!
//! A closing put-port copies them for each such get-port, into a file in the bus's folder or into the process's memory.
//! The get-port deletes them when it reads them; the hub deletes those of get-ports that have ended.

use std::collections::BTreeSet;
use std::fs::OpenOptions;
use std::io::{self, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::PathBuf;

use bytemuck::{Pod, Zeroable};

use crate::Header;
use crate::channel_store::{ChannelFiles, ChannelStore};
use crate::packet::{Block, blocks};

/// First part of the files' names.
const PREFIX: &str = "kept_";

/// Copy of a packet.
#[derive(Debug, Clone)]
pub(crate) struct KeptPacket {
    pub(crate) header: Header,
    pub(crate) data: Box<[Block]>,
}

/// Packets of one put-port for one get-port.
#[derive(Debug)]
pub(crate) struct Parcel {
    pub(crate) sender: u128,
    pub(crate) getter: u128,
    /// Packets that were overwritten before the port closed, or given up for this parcel.
    pub(crate) lost: u64,
    pub(crate) packets: Vec<KeptPacket>,
}

/// Place of a channel's kept packets.
pub(crate) type KeptPackets = ChannelStore<Parcel>;

/// Begin of a parcel's file.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Begin {
    lost: u64,
    packets: u64,
}

impl KeptPackets {
    /// Keeps a parcel. A get-port that has `most` parcels already loses its oldest one.
    ///
    /// # Errors
    /// Not enough memory.
    pub(crate) fn keep(&self, mut parcel: Parcel, most: usize) -> io::Result<()> {
        match self {
            Self::Process(parcels) => {
                let mut parcels = parcels.lock();
                let others = parcels.iter().enumerate();
                let mut others = others.filter(|(_, other)| other.getter == parcel.getter);
                let oldest = others.next().map(|(at, _)| at);
                if let Some(oldest) = oldest.filter(|_| others.count() + 1 >= most) {
                    let oldest = parcels.remove(oldest);
                    parcel.lost += oldest.lost + oldest.packets.len() as u64;
                }
                parcels.push(parcel);
                Ok(())
            }
            Self::Host(files) => {
                let others = of_getter(files, parcel.getter);
                if others.len() >= most {
                    let oldest = read(&others[0]).unwrap_or_default();
                    parcel.lost += oldest.0 + oldest.1.len() as u64;
                    // The get-port may have read it meanwhile.
                    let _ = std::fs::remove_file(&others[0]);
                }
                write(files, &parcel)
            }
        }
    }

    /// Takes all parcels of a get-port, oldest first.
    pub(crate) fn take(&self, getter: u128) -> Vec<Parcel> {
        match self {
            Self::Process(parcels) => {
                let mut parcels = parcels.lock();
                parcels
                    .extract_if(.., |parcel| parcel.getter == getter)
                    .collect()
            }
            Self::Host(files) => {
                let files = of_getter(files, getter);
                let parcels = files.iter().filter_map(|file| {
                    let (lost, packets) = read(file).ok()?;
                    // Another thread of this port may have taken it.
                    std::fs::remove_file(file).ok()?;
                    let name = file.file_name()?.to_str()?;
                    let sender = u128::from_str_radix(name.rsplit('_').next()?, 16).ok()?;
                    Some(Parcel {
                        sender,
                        getter,
                        lost,
                        packets,
                    })
                });
                parcels.collect()
            }
        }
    }

    /// Returns the numbers of the get-ports that have not read their packets.
    pub(crate) fn getters(&self) -> BTreeSet<u128> {
        match self {
            Self::Process(parcels) => {
                let parcels = parcels.lock();
                parcels.iter().map(|parcel| parcel.getter).collect()
            }
            Self::Host(files) => {
                let getter = |(ports, _): (String, PathBuf)| {
                    let (getter, _) = ports.split_once('_')?;
                    u128::from_str_radix(getter, 16).ok()
                };
                files.list(PREFIX).into_iter().filter_map(getter).collect()
            }
        }
    }
}

/// Returns a get-port's files, oldest first.
fn of_getter(files: &ChannelFiles, getter: u128) -> Vec<PathBuf> {
    let begin = format!("{getter:x}_");
    let all = files.list(PREFIX).into_iter();
    let mut files: Vec<_> = all
        .filter(|(ports, _)| ports.starts_with(&begin))
        .filter_map(|(_, path)| Some((path.symlink_metadata().ok()?.modified().ok()?, path)))
        .collect();
    files.sort();
    files.into_iter().map(|(_, path)| path).collect()
}

fn write(files: &ChannelFiles, parcel: &Parcel) -> io::Result<()> {
    let Parcel {
        sender,
        getter,
        lost,
        packets,
    } = parcel;
    let ports = format!("{getter:x}_{sender:x}");
    let unfinished = files.path("unfinished_", &ports);
    let written = || -> io::Result<()> {
        let mut file = OpenOptions::new()
            .write(true)
            .create_new(true)
            .mode(0o600)
            .custom_flags(libc::O_NOFOLLOW)
            .open(&unfinished)?;
        file.write_all(bytemuck::bytes_of(&Begin {
            lost: *lost,
            packets: packets.len() as u64,
        }))?;
        for packet in packets {
            file.write_all(bytemuck::bytes_of(&packet.header))?;
            file.write_all(bytemuck::cast_slice(&packet.data))?;
        }
        std::fs::rename(&unfinished, files.path(PREFIX, &ports))
    };
    written().inspect_err(|_| {
        let _ = std::fs::remove_file(&unfinished);
    })
}

/// Reads a parcel's file.
fn read(file: &std::path::Path) -> io::Result<(u64, Vec<KeptPacket>)> {
    let bytes = std::fs::read(file)?;
    let cut = || io::Error::other("the file is too short");
    let mut rest = bytes.as_slice();
    let mut take = |bytes: usize| -> io::Result<&[u8]> {
        let (first, after) = rest.split_at_checked(bytes).ok_or_else(cut)?;
        rest = after;
        Ok(first)
    };
    let begin: Begin = bytemuck::pod_read_unaligned(take(size_of::<Begin>())?);
    let packets = (0..begin.packets).map(|_| {
        let header: Header = bytemuck::pod_read_unaligned(take(size_of::<Header>())?);
        let count = blocks(usize::try_from(header.bytes).map_err(|_| cut())?);
        let bytes = take(count.checked_mul(size_of::<Block>()).ok_or_else(cut)?)?;
        let mut data = vec![Block::zeroed(); count].into_boxed_slice();
        bytemuck::cast_slice_mut(&mut data).copy_from_slice(bytes);
        Ok(KeptPacket { header, data })
    });
    Ok((begin.lost, packets.collect::<io::Result<_>>()?))
}
