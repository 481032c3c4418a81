//! Line charts with two logarithmic axes, as SVG.

use std::fmt::Write;

/// One line of a chart.
pub(super) struct Line {
    pub(super) name: String,
    /// `(x, y)`, both above zero, ascending in x.
    pub(super) points: Vec<(f64, f64)>,
    /// `(x, lowest y, highest y)`; may be empty.
    pub(super) bars: Vec<(f64, f64, f64)>,
}

/// Colours that people with impaired colour vision can tell apart (Okabe & Ito), with a dash pattern each.
const STYLES: [(&str, &str); 7] = [
    ("#0072b2", ""),
    ("#d55e00", "6 3"),
    ("#009e73", "2 3"),
    ("#cc79a7", "8 3 2 3"),
    ("#e69f00", "1 2"),
    ("#56b4e9", "10 4"),
    ("#777777", "4 2"),
];
const WIDTH: f64 = 560.0;
const HEIGHT: f64 = 340.0;
const LEFT: f64 = 64.0;
const BOTTOM: f64 = 44.0;
const TOP: f64 = 12.0;
const RIGHT: f64 = 130.0;

/// A chart; `None` where fewer than two values of x were measured.
pub(super) fn log_log(x_name: &str, y_name: &str, lines: &[Line]) -> Option<String> {
    let all = || lines.iter().flat_map(|line| &line.points);
    let first = all().next()?;
    if !all().any(|point| point.0 != first.0) {
        return None;
    }
    let decades = |values: &mut dyn Iterator<Item = f64>| {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for value in values {
            low = low.min(value.log10().floor());
            high = high.max(value.log10().ceil());
        }
        (low, high.max(low + 1.0))
    };
    let bars = || lines.iter().flat_map(|line| &line.bars);
    let x_range = decades(&mut all().map(|point| point.0));
    let ys = all().map(|point| point.1);
    let y_range = decades(&mut ys.chain(bars().flat_map(|bar| [bar.1, bar.2])));
    let x = |value: f64| {
        LEFT + (value.log10() - x_range.0) / (x_range.1 - x_range.0) * (WIDTH - LEFT - RIGHT)
    };
    let y = |value: f64| {
        HEIGHT
            - BOTTOM
            - (value.log10() - y_range.0) / (y_range.1 - y_range.0) * (HEIGHT - BOTTOM - TOP)
    };
    let mut svg = format!(
        "<svg viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" aria-label=\"{y_name} over {x_name}\">"
    );
    let right = WIDTH - RIGHT;
    let floor = HEIGHT - BOTTOM;
    for decade in x_range.0 as i32..=x_range.1 as i32 {
        let at = x(10f64.powi(decade));
        let _ = write!(
            svg,
            "<path class=\"grid\" d=\"M{at:.1} {TOP}V{floor}\"/><text x=\"{at:.1}\" y=\"{}\" text-anchor=\"middle\">{}</text>",
            floor + 16.0,
            power(decade)
        );
    }
    for decade in y_range.0 as i32..=y_range.1 as i32 {
        let at = y(10f64.powi(decade));
        let _ = write!(
            svg,
            "<path class=\"grid\" d=\"M{LEFT} {at:.1}H{right}\"/><text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
            LEFT - 6.0,
            at + 4.0,
            power(decade)
        );
    }
    let _ = write!(
        svg,
        "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">{x_name}</text><text transform=\"translate(14 {}) rotate(-90)\" text-anchor=\"middle\">{y_name}</text>",
        (LEFT + right) / 2.0,
        HEIGHT - 8.0,
        floor / 2.0
    );
    for (number, line) in lines.iter().enumerate() {
        let (colour, dash) = STYLES[number % STYLES.len()];
        let path: Vec<String> = line
            .points
            .iter()
            .map(|point| format!("{:.1} {:.1}", x(point.0), y(point.1)))
            .collect();
        let _ = write!(
            svg,
            "<path fill=\"none\" stroke=\"{colour}\" stroke-width=\"2\" stroke-dasharray=\"{dash}\" d=\"M{}\"/>",
            path.join("L")
        );
        for point in &line.points {
            let _ = write!(
                svg,
                "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"3\" fill=\"{colour}\"/>",
                x(point.0),
                y(point.1)
            );
        }
        for bar in &line.bars {
            let _ = write!(
                svg,
                "<path stroke=\"{colour}\" d=\"M{:.1} {:.1}V{:.1}\"/>",
                x(bar.0),
                y(bar.1),
                y(bar.2)
            );
        }
        let at = TOP + 14.0 + 20.0 * number as f64;
        let _ = write!(
            svg,
            "<path stroke=\"{colour}\" stroke-width=\"2\" stroke-dasharray=\"{dash}\" d=\"M{} {at}h24\"/><text x=\"{}\" y=\"{}\">{}</text>",
            right + 10.0,
            right + 40.0,
            at + 4.0,
            line.name
        );
    }
    svg.push_str("</svg>");
    Some(svg)
}

fn power(decade: i32) -> String {
    match decade {
        0..=3 => format!("{}", 10i64.pow(decade as u32)),
        -2..=-1 => format!("{}", 10f64.powi(decade)),
        _ => format!("10<tspan dy=\"-4\" font-size=\"8\">{decade}</tspan>"),
    }
}
