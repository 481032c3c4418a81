//! Services of iceoryx2: one per channel, with its table entry as attributes.

use std::path::{Path as FilePath, PathBuf};
use std::time::{Duration, Instant};

use iceoryx2::prelude::*;
use iceoryx2::service::builder::publish_subscribe::{
    PublishSubscribeCreateError, PublishSubscribeOpenError,
};

use crate::memory_failure::transport_error;
use crate::packet::{Block, Header};
use crate::{ChannelConfig, ChannelError, ChannelId};

/// Maximum time until the hub has freed the places of dead clients.
pub(crate) const CLEARING_UP: Duration = Duration::from_secs(4);

/// Returns the settings of iceoryx2; configuration files of the machine are ignored.
///
/// - `folder`: folder of its files; empty for memory of the process
pub(crate) fn iceoryx_config(folder: &FilePath, prefix: &str) -> Result<Config, ChannelError> {
    let mut config = Config::default();
    if !folder.as_os_str().is_empty() {
        let root = Path::new(folder.as_os_str().as_encoded_bytes())
            .map_err(|error| ChannelError::transport(folder.display(), format!("{error:?}")))?;
        config.global.set_root_path(&root);
    }
    config.global.prefix = FileName::new(format!("{prefix}_").as_bytes())
        .map_err(|error| ChannelError::transport(prefix, format!("{error:?}")))?;
    // Only the hub cleans up, so that clients are not delayed by the remains of others.
    config.global.node.cleanup_dead_nodes_on_creation = false;
    config.global.node.cleanup_dead_nodes_on_destruction = false;
    config.global.service.cleanup_dead_nodes_on_open = false;
    Ok(config)
}

/// Creates a node.
///
/// - `folder`: folder of the bus's files; empty in the process domain
pub(crate) fn node<S: Service>(
    config: &Config,
    folder: &FilePath,
) -> Result<Node<S>, ChannelError> {
    NodeBuilder::new()
        .signal_handling_mode(SignalHandlingMode::Disabled)
        .config(config)
        .create::<S>()
        .map_err(|error| transport_error("bus", folder, error))
}

pub(crate) type Channel<S> =
    iceoryx2::service::port_factory::publish_subscribe::PortFactory<S, [Block], Header>;

fn service_name(id: ChannelId) -> Result<ServiceName, ChannelError> {
    ServiceName::new(id.as_str()?)
        .map_err(|error| ChannelError::transport(id, format!("{error:?}")))
}

/// Opens a channel that the hub has created.
pub(crate) fn open<S: Service>(
    node: &Node<S>,
    id: ChannelId,
    bus: &str,
    folder: &FilePath,
) -> Result<Channel<S>, ChannelError> {
    let begun = Instant::now();
    loop {
        let opened = node
            .service_builder(&service_name(id)?)
            .publish_subscribe::<[Block]>()
            .user_header::<Header>()
            .open();
        match opened {
            Ok(channel) => return Ok(channel),
            // The hub needs some time to free the places of dead clients.
            Err(PublishSubscribeOpenError::ExceedsMaxNumberOfNodes)
                if begun.elapsed() < CLEARING_UP =>
            {
                std::thread::sleep(Duration::from_millis(10));
            }
            Err(PublishSubscribeOpenError::ExceedsMaxNumberOfNodes) => {
                return Err(ChannelError::transport(
                    id,
                    "more clients than its ports allow",
                ));
            }
            Err(
                PublishSubscribeOpenError::VersionMismatch
                | PublishSubscribeOpenError::HangsInCreation
                | PublishSubscribeOpenError::ServiceInCorruptedState,
            ) => {
                let reason = format!(
                    "its shared memory is damaged, or another version has written it; stop its clients and remove {}",
                    folder.display()
                );
                return Err(ChannelError::transport(format!("channel `{id}`"), reason));
            }
            Err(PublishSubscribeOpenError::DoesNotExist) => {
                return Err(ChannelError::NoHub { bus: bus.into() });
            }
            Err(error) => return Err(transport_error(format!("channel `{id}`"), folder, error)),
        }
    }
}

/// Creates a channel, or opens it if it exists and agrees with the table.
pub(crate) fn create<S: Service>(
    node: &Node<S>,
    id: ChannelId,
    config: &ChannelConfig,
    folder: &FilePath,
) -> Result<Channel<S>, ChannelError> {
    let channel = match create_new(node, id, config, folder) {
        Err(ChannelError::ChannelExists { .. }) => open(node, id, "", folder)?,
        created => created?,
    };
    check_attributes(&channel, id, config)?;
    Ok(channel)
}

/// Creates a channel that does not exist.
pub(crate) fn create_new<S: Service>(
    node: &Node<S>,
    id: ChannelId,
    config: &ChannelConfig,
    folder: &FilePath,
) -> Result<Channel<S>, ChannelError> {
    let define = |attributes: AttributeSpecifier, (key, value): (&str, String)| {
        let key = key
            .try_into()
            .unwrap_or_else(|error| panic!("{key} is a valid key: {error:?}"));
        let value = value
            .as_str()
            .try_into()
            .map_err(|error| ChannelError::transport(id, format!("{error:?}")))?;
        attributes
            .define(&key, &value)
            .map_err(|error| ChannelError::transport(id, format!("{error:?}")))
    };
    let attributes = attributes(config)
        .into_iter()
        .try_fold(AttributeSpecifier::new(), define)?;
    let (puts, gets) = (config.total_put_ports(), config.total_get_ports());
    let builder = || -> Result<_, ChannelError> {
        Ok(node
            .service_builder(&service_name(id)?)
            .publish_subscribe::<[Block]>()
            .user_header::<Header>()
            .enable_safe_overflow(true)
            .history_size(config.history)
            .subscriber_max_buffer_size(config.depth)
            .subscriber_max_borrowed_samples(config.taken())
            .max_publishers(puts)
            .max_subscribers(gets)
            // Clients, the hub, and up to eight tools.
            .max_nodes(puts + gets + 8))
    };
    match builder()?.create_with_attributes(&attributes) {
        Ok(channel) => Ok(channel),
        Err(PublishSubscribeCreateError::AlreadyExists) => Err(ChannelError::ChannelExists { id }),
        Err(error) => Err(transport_error(format!("channel `{id}`"), folder, error)),
    }
}

/// Returns the properties of a channel that a port compares when it opens.
fn attributes(config: &ChannelConfig) -> [(&'static str, String); 2] {
    let ChannelConfig {
        items,
        depth,
        put_ports,
        get_ports,
        history,
        held,
        distributed,
        ..
    } = config;
    [
        ("packet", config.describe()),
        (
            "resources",
            format!(
                "{items} items, depth {depth}, {put_ports} put-ports, {get_ports} get-ports, history {history}, {held} held{}",
                if *distributed { ", other hosts" } else { "" }
            ),
        ),
    ]
}

pub(crate) fn check_attributes<S: Service>(
    channel: &Channel<S>,
    id: ChannelId,
    config: &ChannelConfig,
) -> Result<(), ChannelError> {
    for (key, found) in attributes(config) {
        let name = key
            .try_into()
            .unwrap_or_else(|error| panic!("{key} is a valid key: {error:?}"));
        let expected = channel
            .attributes()
            .key_value(&name, 0)
            .map(ToString::to_string);
        if expected.as_deref() != Some(found.as_str()) {
            return Err(ChannelError::Type {
                id,
                expected: expected.unwrap_or_else(|| "something else".into()),
                found: format!("{found} (another table?)"),
            });
        }
    }
    Ok(())
}

/// Returns the file of a channel's wake event.
pub(crate) fn wake_event_file(folder: &FilePath, id: ChannelId) -> Result<PathBuf, ChannelError> {
    Ok(folder.join(format!("wake_{}", id.as_str()?.replace('/', "+"))))
}

/// Returns the file of the wake event for large groups. It exists while a hub runs and after a hub has ended.
pub(crate) fn crowd_file(folder: &FilePath) -> PathBuf {
    folder.join("wake+")
}
