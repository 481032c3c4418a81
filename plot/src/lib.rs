//! Figures as SVG: axes with linear or logarithmic scales, lines, intervals, heat maps.
//!
//! Drawing functions return SVG elements as text; the caller joins them and puts them into a figure. Positions and sizes
//! are in user units, the origin is the upper left corner.
//!
//! - [`figure`] is for a page: its colours come from the page's style sheet, which contains [`theme`] and [`STYLE`], and
//!   adapt to light and dark mode.
//! - [`stand_alone`] is for a file: it contains its style.
//!
//! ```
//! use tactnet_plot::{Axes, Axis, Series, stand_alone};
//!
//! let axes = Axes {
//!     left: 52.0,
//!     top: 10.0,
//!     width: 440.0,
//!     height: 300.0,
//!     horizontal: Axis::decades("packet size [B]", [4.0, 65536.0]).unwrap(),
//!     vertical: Axis::linear("round trip [µs]", 0.0..=20.0, 5.0),
//! };
//! let line = axes.line(Series::nth(0), &[(4.0, 7.5), (65536.0, 18.0)], 1);
//! let svg = stand_alone(510.0, 360.0, "Round trip over packet size", &(axes.grid() + &line));
//! assert!(svg.starts_with("<svg"));
//! ```

mod axes;
mod axis;
mod chi_square;
mod escape;
mod figure;
mod heat_map;
mod legend;
mod page;
mod quantiles;
pub mod report;
mod scale;
mod series;
mod text_width;
mod theme;
#[cfg(test)]
mod well_formed;
mod wilson;

pub use axes::Axes;
pub use axis::{Axis, Tick};
pub use chi_square::chi_square_band;
pub use escape::escape;
pub use figure::{figure, stand_alone};
pub use heat_map::{HeatMap, shade};
pub use legend::{key, legend};
pub use page::Page;
pub use quantiles::{Quantiles, quantile};
pub use scale::Scale;
pub use series::Series;
pub use text_width::text_width;
pub use theme::{STYLE, theme};
pub use wilson::{wilson, wilson_of_counts};
