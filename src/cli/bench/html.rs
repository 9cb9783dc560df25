//! Figures as one self-contained HTML page: no script, no link to elsewhere.

use std::fmt::Write;

use khz_scheduler::StatisticsReport;

use super::super::page::{END, escaped, head};
use super::Figures;

/// Bars of a histogram.
const BARS: usize = 60;
/// Size of a histogram, in pixels.
const WIDTH: usize = 720;
const HEIGHT: usize = 160;

/// The page of `khz bench --report`.
pub fn page(file: &str, all: &[Figures]) -> String {
    let mut out = head("khz bench", "", &format!("Time of a scan: {}", escaped(file)));
    out.push_str("<table><tr><th>engine</th><th>median</th><th>min</th><th>p99</th><th>p99.9</th><th>max</th><th>scans</th><th>code bytes</th><th>front end</th><th>verify</th><th>engine</th></tr>");
    for figures in all {
        let d = figures.measured.distribution;
        let [frontend, verify, engine] = figures.compile_ns.map(|ns| ns as f64 / 1e6);
        // Writing to a String does not fail, here and below.
        let _ = write!(
            out,
            "<tr><td>{}</td><td>{:.1} ns</td><td>{:.1}</td><td>{:.1}</td><td>{:.1}</td><td>{:.1}</td><td>{}</td><td>{}</td><td>{frontend:.2} ms</td><td>{verify:.2} ms</td><td>{engine:.2} ms</td></tr>",
            figures.engine, d.median, d.min, d.p99, d.p999, d.max, figures.measured.scans, figures.code_bytes
        );
    }
    out.push_str("</table>");
    for figures in all {
        let _ = write!(out, "<h2>{}</h2>", figures.engine);
        histogram(&mut out, &figures.measured.batches);
    }
    out + "<p>A scan is one cycle of each task, timed in batches of at least 100 µs. The slowest 1 % of the batches stand in the last bar.</p>"
        + END
}

/// The page of `khz bench --jitter --report`.
pub fn jitter_page(statistics: &StatisticsReport, names: &[String]) -> String {
    let mut out = head("khz bench --jitter", "", "Start latency of each task on the real clock");
    out.push_str("<table><tr><th>task</th><th>starts</th><th>min</th><th>median</th><th>p99</th><th>p99.9</th><th>max</th><th>overruns</th></tr>");
    for (position, task) in statistics.tasks.iter().enumerate() {
        let Some(late) = &task.jitter else { continue };
        let name = names.get(position).map_or_else(|| format!("task {}", task.id), |name| escaped(name));
        let [median, p99, p999] = [late.median, late.p99, late.p999].map(Option::unwrap_or_default);
        let _ = write!(
            out,
            "<tr><td>{name}</td><td>{}</td><td>{} ns</td><td>{median}</td><td>{p99}</td><td>{p999}</td><td>{}</td><td>{}</td></tr>",
            late.count, late.min, late.max, task.overruns
        );
    }
    out.push_str("</table>");
    for (position, task) in statistics.tasks.iter().enumerate() {
        let Some(late) = &task.jitter else { continue };
        let name = names.get(position).map_or_else(|| format!("task {}", task.id), |name| escaped(name));
        let _ = write!(out, "<h2>{name}</h2>");
        bars(
            &mut out,
            &[
                ("min", late.min),
                ("median", late.median.unwrap_or_default()),
                ("p99", late.p99.unwrap_or_default()),
                ("p99.9", late.p999.unwrap_or_default()),
                ("max", late.max),
            ],
        );
    }
    out + END
}

/// One horizontal bar a figure, all to the scale of the largest.
fn bars(out: &mut String, figures: &[(&str, u64)]) {
    let most = figures.iter().map(|figure| figure.1).max().unwrap_or(1).max(1);
    let _ = write!(out, "<svg width=\"{WIDTH}\" height=\"{}\" role=\"img\">", figures.len() * 24);
    for (at, (name, ns)) in figures.iter().enumerate() {
        let width = u128::from(*ns) * (WIDTH as u128 - 200) / u128::from(most);
        let (top, middle) = (at * 24 + 4, at * 24 + 16);
        let _ = write!(
            out,
            "<text x=\"4\" y=\"{middle}\">{name}</text><rect x=\"60\" y=\"{top}\" width=\"{width}\" height=\"16\"/><text x=\"{}\" y=\"{middle}\">{ns} ns</text>",
            66 + width
        );
    }
    out.push_str("</svg>");
}

/// How many batches took how long, from the fastest to the 99th percentile; the rest is in the last bar.
fn histogram(out: &mut String, batches: &[f64]) {
    let mut sorted = batches.to_vec();
    sorted.sort_by(f64::total_cmp);
    let Some((&low, &high)) = sorted.first().zip(sorted.get(sorted.len().saturating_sub(1) * 99 / 100)) else { return };
    let width = ((high - low) / BARS as f64).max(f64::MIN_POSITIVE);
    let mut bars = [0_usize; BARS];
    for ns in &sorted {
        bars[(((ns - low) / width) as usize).min(BARS - 1)] += 1;
    }
    let most = bars.iter().copied().max().unwrap_or(1).max(1);
    let _ = write!(out, "<svg width=\"{WIDTH}\" height=\"{}\" role=\"img\">", HEIGHT + 20);
    let bar_width = WIDTH / BARS;
    for (at, count) in bars.iter().enumerate() {
        let height = count * HEIGHT / most;
        let _ = write!(
            out,
            "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{height}\"><title>{count} batches near {:.1} ns</title></rect>",
            at * bar_width,
            HEIGHT - height,
            bar_width - 1,
            low + width * (at as f64 + 0.5)
        );
    }
    let _ = write!(
        out,
        "<text x=\"0\" y=\"{0}\">{low:.1} ns</text><text x=\"{WIDTH}\" y=\"{0}\" text-anchor=\"end\">{high:.1} ns</text></svg>",
        HEIGHT + 15
    );
}
