//! Figures as one self-contained HTML page: no script, no link to elsewhere.

use std::fmt::Write;

use khz_scheduler::StatisticsReport;

use super::super::page::{END, escaped, head};
use super::Figures;

/// Bars of a histogram.
const BARS: usize = 60;
/// Columns of a plot over time.
const COLUMNS: usize = 360;
/// Size of a plot, in pixels.
const WIDTH: usize = 720;
const HEIGHT: usize = 160;

/// The page of `khz bench --report`.
pub fn page(file: &str, all: &[Figures]) -> String {
    let mut out = head("khz bench", "", &format!("Time of a scan: {}", escaped(file)));
    let fastest = all.iter().map(|figures| figures.measured.distribution.median).fold(f64::INFINITY, f64::min);
    table(
        &mut out,
        &["engine", "median, ns", "ratio", "mean", "min", "p99", "p99.9", "max", "scans"],
        all.iter().map(|figures| {
            let d = figures.measured.distribution;
            let ratio = format!("{:.2}", d.median / fastest);
            let ns = |ns: f64| format!("{ns:.1}");
            let scans = figures.measured.scans.to_string();
            vec![ns(d.median), ratio, ns(d.mean), ns(d.min), ns(d.p99), ns(d.p999), ns(d.max), scans]
        }),
        all,
    );
    side_by_side(&mut out, "Median of a scan", all, |figures| figures.measured.distribution.median as u64);
    side_by_side(&mut out, "99th percentile", all, |figures| figures.measured.distribution.p99 as u64);
    out.push_str("<h2>From source to code</h2>");
    table(
        &mut out,
        &["engine", "front end, ms", "verify, ms", "made ready, ms", "together, ms", "container, bytes", "code, bytes"],
        all.iter().map(|figures| {
            let ms = |ns: u64| format!("{:.3}", ns as f64 / 1e6);
            let [frontend, verify, engine] = figures.compile_ns;
            let (container, code) = (figures.container_bytes.to_string(), figures.code_bytes.to_string());
            vec![ms(frontend), ms(verify), ms(engine), ms(frontend + verify + engine), container, code]
        }),
        all,
    );
    for figures in all {
        let _ = write!(out, "<h2>{}</h2><h3>Distribution</h3>", figures.engine);
        histogram(&mut out, &figures.measured.batches);
        out.push_str("<h3>In the order of time</h3>");
        over_time(&mut out, &figures.measured.batches);
    }
    out + "<p>A scan is one cycle of each task, timed in batches of at least 100 µs: times are averages of a batch. In the distribution the slowest 1 % \
           of the batches stand in the last bar; in the order of time they end at the upper edge.</p>"
        + END
}

/// A table with a row for each engine.
fn table(out: &mut String, titles: &[&str], rows: impl Iterator<Item = Vec<String>>, all: &[Figures]) {
    let title = |title: &&str| format!("<th>{title}</th>");
    let _ = write!(out, "<table><tr>{}</tr>", titles.iter().map(title).collect::<String>());
    for (figures, cells) in all.iter().zip(rows) {
        let cells: String = cells.iter().map(|cell| format!("<td>{cell}</td>")).collect();
        let _ = write!(out, "<tr><td>{}</td>{cells}</tr>", figures.engine);
    }
    out.push_str("</table>");
}

/// One bar for each engine.
fn side_by_side(out: &mut String, title: &str, all: &[Figures], ns: impl Fn(&Figures) -> u64) {
    let _ = write!(out, "<h3>{title}</h3>");
    let figures: Vec<(&str, u64)> = all.iter().map(|figures| (figures.engine, ns(figures))).collect();
    bars(out, &figures);
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

/// The fastest batch and the 99th percentile.
fn range(batches: &[f64]) -> Option<(f64, f64)> {
    let mut sorted = batches.to_vec();
    sorted.sort_by(f64::total_cmp);
    Some((*sorted.first()?, *sorted.get(sorted.len().saturating_sub(1) * 99 / 100)?))
}

/// The batches in the order in which they ran: of those that share a column, from the fastest to the slowest. What is slower than the
/// 99th percentile ends there.
fn over_time(out: &mut String, batches: &[f64]) {
    let Some((low, high)) = range(batches) else { return };
    let height = |ns: f64| ((ns.min(high) - low) / (high - low).max(f64::MIN_POSITIVE) * HEIGHT as f64) as usize;
    let _ = write!(out, "<svg width=\"{WIDTH}\" height=\"{}\" role=\"img\">", HEIGHT + 20);
    let each = batches.len().div_ceil(COLUMNS).max(1);
    for (at, column) in batches.chunks(each).enumerate() {
        let bottom = height(column.iter().copied().fold(f64::INFINITY, f64::min));
        let top = height(column.iter().copied().fold(0.0, f64::max)).max(bottom + 1);
        let _ = write!(
            out,
            "<rect x=\"{}\" y=\"{}\" width=\"1\" height=\"{}\"/>",
            at * WIDTH / COLUMNS,
            HEIGHT.saturating_sub(top),
            top - bottom
        );
    }
    let _ = write!(
        out,
        "<text x=\"0\" y=\"{0}\">{low:.1} to {high:.1} ns, {1} batches</text></svg>",
        HEIGHT + 15,
        batches.len()
    );
}

/// How many batches took how long, from the fastest to the 99th percentile; the rest is in the last bar.
fn histogram(out: &mut String, batches: &[f64]) {
    let Some((low, high)) = range(batches) else { return };
    let width = ((high - low) / BARS as f64).max(f64::MIN_POSITIVE);
    let mut bars = [0_usize; BARS];
    for ns in batches {
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
