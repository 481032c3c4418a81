//! Messages of recordings, and packets of the tactile channels as bytes.

use bytemuck::Zeroable;
use tactnet_recording::Recordable;
use tactnet_skin::packets::{
    ModelNames, SkinFrame, SweepCommand, TactileBelief, TactileStatus, Text,
};

use super::Target;

/// Input: a byte that selects the message type, and the message.
pub(super) fn messages() -> Target {
    let mut frame = SkinFrame::zeroed();
    frame.taxels = 16;
    let mut command = SweepCommand::zeroed();
    command.kind = 4;
    command.material = Text::new("felt");
    let mut belief = TactileBelief::zeroed();
    belief.materials = 3;
    belief.posterior[..3].copy_from_slice(&[0.5, 0.25, 0.25]);
    let mut names = ModelNames::zeroed();
    names.sample_rate_hz = 750.0;
    names.materials = 1;
    names.names[0] = Text::new("felt");
    let messages = [
        frame.to_message(),
        command.to_message(),
        belief.to_message(),
        TactileStatus::zeroed().to_message(),
        names.to_message(),
    ];
    let seeds = (0..).zip(messages).map(|(kind, message)| {
        let mut seed = vec![kind];
        seed.extend(message);
        seed
    });
    let mut target = Target::new(seeds.collect(), |input| {
        let Some((kind, message)) = input.split_first() else {
            return false;
        };
        match kind % 5 {
            0 => reads::<SkinFrame>(message),
            1 => reads::<SweepCommand>(message),
            2 => reads::<TactileBelief>(message),
            3 => reads::<TactileStatus>(message),
            _ => reads::<ModelNames>(message),
        }
    });
    target.may_abort = false;
    target.ceiling = 8 << 20;
    target
}

/// Reads a message. Writing and reading it again must give the same result.
fn reads<T: Recordable>(message: &[u8]) -> bool {
    let Some(packet) = T::from_message(message) else {
        return false;
    };
    let written = packet.to_message();
    let again = T::from_message(&written).map(|packet| packet.to_message());
    assert_eq!(again.as_deref(), Some(&written[..]));
    true
}
