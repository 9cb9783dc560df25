//! The page of `--report`: both curves of every variable, the tolerance between them, the first difference.

use std::fmt::Write;

use khz_bytecode::container::ElementaryType;
use khz_machine::variables::Domain;
use kilohertz::traces::compare::{Compared, MAX_CURVES};
use kilohertz::traces::curve::{Curve, STRETCHES};

use super::super::page::{END, escaped, head};
use super::against::{Outcomes, column_name, first_line, largest_text, tolerance_text, verdict};

/// Height of a curve and of a digital lane, in pixels.
const CURVE_HEIGHT: f64 = 140.0;
const LANE_HEIGHT: f64 = 44.0;
/// Room above and below, for labels of the time below.
const MARGIN: f64 = 8.0;
const AXIS_HEIGHT: f64 = 18.0;

const STYLE: &str = "polyline,path{fill:none;stroke-width:1.5}.theirs{stroke:#d9822b}.ours{stroke:#3b6ea5}.band{fill:#d9822b;opacity:.18;stroke:none}\
.first{stroke:#c23030;stroke-dasharray:4 3}.bad{color:#c23030}.key{display:inline-block;width:1.6em;height:.5em;margin:0 .4em 0 1em}h2{font-size:1.05em;margin:1.4em 0 .2em}";

/// The whole page.
pub fn page(outcomes: &Outcomes<'_>) -> String {
    let mut out = head("khz diff --against", STYLE, &format!("Program against {}", escaped(&outcomes.file)));
    // Writing to a String does not fail, here and below.
    let _ = write!(out, "<p><b>{}</b></p><p>{}</p>", escaped(&verdict(outcomes)), escaped(&first_line(outcomes)));
    if let Some(ended) = &outcomes.ended {
        let _ = write!(out, "<pre class=\"bad\">{}</pre>", escaped(ended));
    }
    table(&mut out, outcomes);
    out.push_str("<p><span class=\"key\" style=\"background:#d9822b\"></span>trace<span class=\"key\" style=\"background:#3b6ea5\"></span>program<span class=\"key\" style=\"background:#c23030\"></span>first difference</p>");
    let mut drawn = 0;
    for column in outcomes.comparer.columns() {
        let Some([theirs, ours]) = &column.curves else { continue };
        if theirs.bounds().is_none() && ours.bounds().is_none() {
            continue;
        }
        drawn += 1;
        let _ = write!(out, "<h2>{}</h2>", escaped(&column_name(outcomes, column)));
        draw(&mut out, outcomes, column, theirs, ours);
    }
    let rest = outcomes.comparer.columns().len() - drawn;
    if rest > 0 {
        let _ = write!(out, "<p>{rest} variables have no curve: texts, and those behind the first {MAX_CURVES}.</p>");
    }
    out + END
}

fn table(out: &mut String, outcomes: &Outcomes<'_>) {
    out.push_str("<table><tr><th>variable</th><th>values</th><th>tolerance</th><th>differ</th><th>first: line</th><th>at</th><th>trace</th><th>program</th><th>largest deviation</th><th>at</th></tr>");
    for column in outcomes.comparer.columns() {
        let class = if column.beyond > 0 { " class=\"bad\"" } else { "" };
        let _ = write!(
            out,
            "<tr{class}><td>{}</td><td>{}</td><td>{}</td><td>{}</td>",
            escaped(&column_name(outcomes, column)),
            column.rows,
            escaped(&tolerance_text(outcomes, column)),
            column.beyond
        );
        match &column.first {
            Some(first) => {
                let [theirs, ours] = first.values.map(|value| escaped(&outcomes.comparer.text(column, value)));
                let _ = write!(
                    out,
                    "<td>{}</td><td>{}</td><td>{theirs}</td><td>{ours}</td>",
                    first.line,
                    seconds(first.time_us)
                );
            }
            None => out.push_str("<td></td><td></td><td></td><td></td>"),
        }
        match largest_text(outcomes, column) {
            Some((deviation, largest)) => {
                let _ = write!(out, "<td>{}</td><td>{}</td></tr>", escaped(&deviation), seconds(largest.time_us));
            }
            None => out.push_str("<td></td><td></td></tr>"),
        }
    }
    out.push_str("</table>");
}

fn seconds(time_us: i64) -> String {
    format!("{:.6} s", time_us as f64 / 1e6)
}

/// From values to pixels.
struct Scale {
    low: f64,
    high: f64,
    height: f64,
}

impl Scale {
    fn y(&self, value: f64) -> f64 {
        // In halves, so that the ends of the number range do not overflow.
        let share = (value / 2.0 - self.low / 2.0) / (self.high / 2.0 - self.low / 2.0);
        MARGIN + (1.0 - share.clamp(0.0, 1.0)) * self.height
    }
}

fn draw(out: &mut String, outcomes: &Outcomes<'_>, column: &Compared, theirs: &Curve, ours: &Curve) {
    let domain = &outcomes.trace.columns[column.column].domain;
    let is_lane = matches!(domain, Domain::Elementary(ElementaryType::Bool));
    let bounds = [theirs.bounds(), ours.bounds()].into_iter().flatten().reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
    let (low, high) = if is_lane { (0.0, 1.0) } else { bounds.unwrap_or((0.0, 1.0)) };
    let (low, high) = if low < high { (low, high) } else { (low - 1.0, high + 1.0) };
    let scale = Scale { low, high, height: if is_lane { LANE_HEIGHT } else { CURVE_HEIGHT } };
    let bottom = scale.height + 2.0 * MARGIN;
    let _ = write!(
        out,
        "<svg width=\"{STRETCHES}\" height=\"{}\" viewBox=\"0 0 {STRETCHES} {0}\" role=\"img\">",
        bottom + AXIS_HEIGHT
    );
    if !is_lane {
        band(out, column, theirs, &scale);
    }
    line(out, "theirs", theirs, &scale);
    line(out, "ours", ours, &scale);
    if let Some(first) = &column.first {
        let x = theirs.position(first.time_us);
        let [trace, program] = first.values.map(|value| escaped(&outcomes.comparer.text(column, value)));
        let _ = write!(
            out,
            "<path class=\"first\" d=\"M{x} 0V{bottom}\"><title>line {}, {}: trace {trace}, program {program}</title></path>",
            first.line,
            seconds(first.time_us)
        );
    }
    let (begin, end) = theirs.span_us();
    let axis = bottom + AXIS_HEIGHT - 5.0;
    let _ = write!(
        out,
        "<text x=\"2\" y=\"{axis}\">{}</text><text x=\"{}\" y=\"{axis}\" text-anchor=\"end\">{}</text>",
        seconds(begin),
        STRETCHES - 2,
        seconds(end)
    );
    if !is_lane {
        let _ = write!(
            out,
            "<text x=\"2\" y=\"{}\">{high}</text><text x=\"2\" y=\"{}\">{low}</text>",
            MARGIN + 9.0,
            scale.height + MARGIN
        );
    }
    out.push_str("</svg>");
}

/// A curve: in each stretch from its first value over both ends to the last; level in between, to the right end.
fn line(out: &mut String, class: &str, curve: &Curve, scale: &Scale) {
    let _ = write!(out, "<polyline class=\"{class}\" points=\"");
    let mut last = None;
    for (x, stretch) in curve.stretches() {
        let is_level = stretch.least == stretch.greatest && last == Some(scale.y(stretch.first));
        if is_level {
            continue;
        }
        if let Some(level) = last {
            let _ = write!(out, "{x},{level:.1} ");
        }
        let points = [stretch.first, stretch.least, stretch.greatest, stretch.last].map(|value| scale.y(value));
        let mut before = None;
        for y in points {
            if before != Some(y) {
                let _ = write!(out, "{x},{y:.1} ");
            }
            before = Some(y);
        }
        last = before;
    }
    if let Some(level) = last {
        let _ = write!(out, "{STRETCHES},{level:.1}");
    }
    out.push_str("\"/>");
}

/// What is allowed around the trace: along its greatest values and back along its least.
fn band(out: &mut String, column: &Compared, theirs: &Curve, scale: &Scale) {
    if column.tolerance.limit(1.0) == 0.0 {
        return;
    }
    let stretches: Vec<_> = theirs.stretches().collect();
    let edge = |value: f64, sign: f64| scale.y(value + sign * column.tolerance.limit(value));
    let _ = write!(out, "<polygon class=\"band\" points=\"");
    for (position, (x, stretch)) in stretches.iter().enumerate() {
        let end = stretches.get(position + 1).map_or(STRETCHES, |next| next.0);
        let (peak, level) = (edge(stretch.greatest, 1.0), edge(stretch.last, 1.0));
        let _ = write!(out, "{x},{peak:.1} {x},{level:.1} {end},{level:.1} ");
    }
    for (position, (x, stretch)) in stretches.iter().enumerate().rev() {
        let end = stretches.get(position + 1).map_or(STRETCHES, |next| next.0);
        let (peak, level) = (edge(stretch.least, -1.0), edge(stretch.last, -1.0));
        let _ = write!(out, "{end},{level:.1} {x},{level:.1} {x},{peak:.1} ");
    }
    out.push_str("\"/>");
}
