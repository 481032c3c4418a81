//! Remedies of errors in channels and recordings, in the words of the command line.

use std::error::Error;

use tactnet_channel::{ChannelError, Remedy};
use tactnet_serving::ServeError;
use tactnet_simulation::SimulationError;

/// Returns the command or flag that cures an error, as a clause that follows its message.
pub(super) fn words_of_channels(cause: &(dyn Error + 'static)) -> Option<&'static str> {
    channel_error(cause)
        .and_then(ChannelError::remedy)
        .map(|remedy| match remedy {
            Remedy::StartHub => "start `tactnet channel hub --table FILE` with the same table",
        })
        .or_else(|| recording_remedy(cause))
}

/// Returns the channel error that a cause is or wraps without a text of its own.
fn channel_error<'a>(cause: &'a (dyn Error + 'static)) -> Option<&'a ChannelError> {
    if let Some(ServeError::Channel(error)) = cause.downcast_ref() {
        return Some(error);
    }
    if let Some(SimulationError::Channel(error)) = cause.downcast_ref() {
        return Some(error);
    }
    #[cfg(feature = "recording")]
    if let Some(tactnet_recording::RecordingError::Channel(error)) = cause.downcast_ref() {
        return Some(error);
    }
    #[cfg(feature = "catching")]
    {
        use tactnet_catching_roles::RoleError;
        use tactnet_catching_stage::StageError;
        if let Some(RoleError::Channel(error)) = cause.downcast_ref() {
            return Some(error);
        }
        if let Some(StageError::Channel(error)) = cause.downcast_ref() {
            return Some(error);
        }
    }
    cause.downcast_ref()
}

#[cfg(feature = "recording")]
fn recording_remedy(cause: &(dyn Error + 'static)) -> Option<&'static str> {
    use tactnet_recording::{RecordingError, RecordingRemedy};
    let error: &RecordingError = cause.downcast_ref()?;
    error.remedy().map(|remedy| match remedy {
        RecordingRemedy::UseDescribedPackets => {
            "`tactnet channel packets` prints the types that can be recorded"
        }
        RecordingRemedy::WriteFile => "or write a file with `--save`",
        RecordingRemedy::NameShape => "`--shape` names rows and columns",
        RecordingRemedy::NameRate => "`--rate` names the frames per second",
        RecordingRemedy::NameTopic => {
            "`tactnet data import` reads one with `--topic NAME --field PATH`"
        }
    })
}

#[cfg(not(feature = "recording"))]
fn recording_remedy(_: &(dyn Error + 'static)) -> Option<&'static str> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wrapped_errors_have_the_same_remedy() {
        let no_hub = || ChannelError::NoHub { bus: "a".into() };
        let expected = "start `tactnet channel hub --table FILE` with the same table";
        assert_eq!(words_of_channels(&no_hub()), Some(expected));
        assert_eq!(
            words_of_channels(&ServeError::Channel(no_hub())),
            Some(expected)
        );
        assert_eq!(
            words_of_channels(&SimulationError::Channel(no_hub())),
            Some(expected)
        );
        assert_eq!(words_of_channels(&ChannelError::EmptyGroup), None);
    }
}
