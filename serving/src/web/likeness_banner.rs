//! Banner of the page while sweeps are unlike the training data.

use tactnet_skin::packets::{Event, TactileStatus};

/// Number of verdicts in succession that show the banner. Of single verdicts on sweeps like the training data, 5 % are wrong.
const VERDICTS: u32 = 2;

/// Newest verdicts on the likeness with the training data.
#[derive(Debug, Default)]
pub(super) struct LikenessBanner {
    /// Number of verdicts `unlike` in succession.
    unlike: u32,
    /// Text of the newest one.
    text: String,
}

impl LikenessBanner {
    /// Counts a verdict; other events count nothing. Returns true if the banner has just appeared.
    pub(super) fn take(&mut self, status: &TactileStatus) -> bool {
        if status.event == Event::Unlike as u32 {
            self.unlike = self.unlike.saturating_add(1);
            self.text = status.text.as_str().into();
            return self.unlike == VERDICTS;
        }
        if is_verdict(status) {
            self.unlike = 0;
        }
        false
    }

    /// Returns the text of the banner; `None` while there is none.
    pub(super) fn text(&self) -> Option<&str> {
        (self.unlike >= VERDICTS).then_some(&self.text)
    }
}

/// Returns true if the event is a verdict on the likeness with the training data.
pub(super) fn is_verdict(status: &TactileStatus) -> bool {
    [Event::Like, Event::OtherBlock, Event::Unlike]
        .iter()
        .any(|event| status.event == *event as u32)
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;
    use tactnet_skin::packets::Text;

    use super::*;

    #[test]
    fn the_banner_needs_two_verdicts_and_goes_with_the_next_good_one() {
        let mut banner = LikenessBanner::default();
        let mut shown = |event: Event, text: &str| {
            let status = TactileStatus {
                event: event as u32,
                text: Text::new(text),
                ..TactileStatus::zeroed()
            };
            let appeared = banner.take(&status);
            (appeared, banner.text().map(String::from))
        };
        let text = |text: &str| Some(text.to_owned());
        assert_eq!(shown(Event::Unlike, "UNLIKE: a"), (false, None));
        assert_eq!(shown(Event::Like, "like"), (false, None));
        assert_eq!(shown(Event::Unlike, "UNLIKE: b"), (false, None));
        // A reset is no verdict.
        assert_eq!(shown(Event::Reset, ""), (false, None));
        assert_eq!(shown(Event::Unlike, "UNLIKE: c"), (true, text("UNLIKE: c")));
        assert_eq!(
            shown(Event::Unlike, "UNLIKE: d"),
            (false, text("UNLIKE: d"))
        );
        assert_eq!(shown(Event::Alive, ""), (false, text("UNLIKE: d")));
        assert_eq!(shown(Event::OtherBlock, "like another"), (false, None));
    }
}
