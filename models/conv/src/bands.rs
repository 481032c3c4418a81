//! Division of a row of taxels, or of the steps of a sweep, into bands that are convolved separately (overlap-save).

use std::ops::Range;

/// Division of a row of `len` values into bands with `span` outputs each; the last band may be shorter.
///
/// Each band reads `width` inputs, of which `pad` come before its first output. Inputs outside the row are zero.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Bands {
    pub(super) len: usize,
    pub(super) span: usize,
    pub(super) width: usize,
    pad: usize,
}

impl Bands {
    /// Returns a single band; the transform pads it with zeros.
    pub(super) fn one(len: usize) -> Self {
        Self {
            len,
            span: len,
            width: len,
            pad: 0,
        }
    }

    /// Returns the fewest bands of equal span that read at most `width` inputs, of which `pad` lie on either side of the outputs.
    pub(super) fn at_most(width: usize, len: usize, pad: usize) -> Self {
        if len <= width {
            return Self::one(len);
        }
        let widest = width.saturating_sub(2 * pad).max(1);
        Self::of_span(len.div_ceil(len.div_ceil(widest)), len, pad)
    }

    /// Returns bands of `span` outputs with `pad` more inputs on either side; a single band if that covers the row.
    pub(super) fn of_span(span: usize, len: usize, pad: usize) -> Self {
        if span >= len {
            return Self::one(len);
        }
        Self {
            len,
            span,
            width: span + 2 * pad,
            pad,
        }
    }

    /// Returns the number of bands.
    pub(super) fn count(&self) -> usize {
        self.len.div_ceil(self.span)
    }

    /// Returns the positions in the row of a band's outputs.
    pub(super) fn outputs(&self, band: usize) -> Range<usize> {
        band * self.span..self.len.min((band + 1) * self.span)
    }

    /// Returns the position in the row of a band's input `at`; `None` outside the row.
    #[inline(always)]
    pub(super) fn input(&self, band: usize, at: usize) -> Option<usize> {
        let place = (band * self.span + at).wrapping_sub(self.pad);
        (place < self.len).then_some(place)
    }

    /// Returns the position in the row of a band's input `at` if it is also one of the band's outputs.
    #[inline(always)]
    pub(super) fn output(&self, band: usize, at: usize) -> Option<usize> {
        let own = at.wrapping_sub(self.pad);
        let place = (band * self.span).wrapping_add(own);
        (own < self.span && place < self.len).then_some(place)
    }

    /// Iterates over the bands that read a position of the row, with the index among their inputs.
    pub(super) fn seeing(&self, place: usize) -> impl Iterator<Item = (usize, usize)> {
        let reach = place + self.pad;
        let first = (reach + 1).saturating_sub(self.width).div_ceil(self.span);
        let last = (reach / self.span).min(self.count() - 1);
        let span = self.span;
        (first..=last).map(move |band| (band, reach - band * span))
    }

    /// Returns true if there are several bands.
    pub(super) fn is_cut(&self) -> bool {
        self.span < self.len
    }

    /// Returns the index of the first output among a band's inputs.
    pub(super) fn margin(&self) -> usize {
        self.pad
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outputs_partition_the_row_and_inputs_reach_around_them() {
        for (width, taxels, pad) in [
            (32, 33, 2),
            (32, 64, 2),
            (16, 1024, 3),
            (32, 60, 0),
            (16, 16, 2),
            (8, 9, 3),
        ] {
            let bands = Bands::at_most(width, taxels, pad);
            let outputs = (0..bands.count()).flat_map(|band| bands.outputs(band));
            assert!(outputs.eq(0..taxels), "{bands:?}");
            assert!(bands.width <= width, "{bands:?}");
            for band in 0..bands.count() {
                let found = (0..bands.width).filter_map(|at| bands.output(band, at));
                assert!(found.eq(bands.outputs(band)), "{bands:?}");
                let all = bands.outputs(band);
                let reach = if bands.count() == 1 { 0 } else { pad };
                let seen = (0..bands.width).filter_map(|at| bands.input(band, at));
                let last = (band * bands.span + bands.span + reach).min(taxels);
                assert!(seen.eq(all.start.saturating_sub(reach)..last), "{bands:?}");
                for at in 0..bands.width {
                    if let Some(place) = bands.input(band, at) {
                        assert!(
                            bands.seeing(place).any(|found| found == (band, at)),
                            "{bands:?}"
                        );
                    }
                }
            }
            for place in 0..taxels {
                for (band, at) in bands.seeing(place) {
                    assert_eq!(bands.input(band, at), Some(place), "{bands:?}");
                }
            }
        }
    }
}
