//! The page of `khz bench --report`, taken apart: it needs nothing from elsewhere, and shows the figures of the same run.

mod common;

use common::{Scratch, khz, stderr};
use quick_xml::Reader;
use quick_xml::events::Event;
use serde_json::Value;

/// An element with its attributes, and the text in it that is its own.
#[derive(Debug, Default)]
struct Element {
    name: String,
    attributes: Vec<(String, String)>,
    text: String,
}

impl Element {
    fn number(&self, attribute: &str) -> f64 {
        let found = self.attributes.iter().find(|(name, _)| name == attribute);
        found.unwrap_or_else(|| panic!("no {attribute}: {self:?}")).1.parse().unwrap()
    }
}

/// All elements in the order of their ends; refuses what is not nested rightly.
fn elements(page: &str) -> Vec<Element> {
    let mut reader = Reader::from_str(page);
    let (mut open, mut done): (Vec<Element>, Vec<Element>) = (Vec::new(), Vec::new());
    let element = |start: &quick_xml::events::BytesStart<'_>| {
        let attributes = start.attributes().map(|attribute| {
            let attribute = attribute.unwrap();
            (attribute.key.as_ref().to_owned(), attribute.value.to_string())
        });
        let name = start.name().as_ref().to_owned();
        Element { name, attributes: attributes.collect(), text: String::new() }
    };
    loop {
        match reader.read_event().unwrap() {
            Event::Start(start) => open.push(element(&start)),
            Event::Empty(start) => done.push(element(&start)),
            Event::Text(text) => {
                if let Some(element) = open.last_mut() {
                    element.text += &text;
                }
            }
            Event::End(_) => done.push(open.pop().unwrap()),
            Event::Eof => break,
            _ => {}
        }
    }
    assert!(open.is_empty(), "{open:?}");
    done
}

#[test]
fn the_page_stands_alone_and_shows_the_figures_of_its_run() {
    let scratch = Scratch::new("report");
    let text =
        "PROGRAM Main VAR i, n : DINT; END_VAR FOR i := 0 TO 99 DO n := (n * 7 + i) MOD 1000; END_FOR; END_PROGRAM";
    let source = scratch.write("a<b&c.st", text);
    let (json, html) = (scratch.path("bench.json"), scratch.path("bench.html"));
    let mut command = khz();
    command.args(["bench", "--scans", "20000", "--json"]).arg(&json).arg("--report").arg(&html).arg(&source);
    let output = command.output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let page = std::fs::read_to_string(html).unwrap();
    let figures: Value = serde_json::from_str(&std::fs::read_to_string(json).unwrap()).unwrap();
    let elements = elements(&page);

    // Nothing is fetched, nothing runs.
    for element in &elements {
        let allowed =
            ["html", "head", "meta", "title", "style", "body", "h1", "h2", "h3", "p", "table", "tr", "th", "td"];
        let drawn = ["svg", "rect", "text"];
        assert!(allowed.iter().chain(&drawn).any(|name| *name == element.name), "{element:?}");
        assert!(element.attributes.iter().all(|(name, _)| !["src", "href"].contains(&name.as_str())), "{element:?}");
    }
    assert!(!page.contains("url(") && !page.contains("@import") && !page.contains("http"));
    let heading = elements.iter().find(|element| element.name == "h1").unwrap();
    assert!(page.contains("a&lt;b&amp;c.st") && heading.text.starts_with("Time of a scan"), "{heading:?}");

    // The cells of both tables, engine by engine.
    let cells: Vec<&str> = elements.iter().filter(|e| e.name == "td").map(|e| e.text.as_str()).collect();
    let (times, code) = cells.split_at(18);
    for (engine, row) in [0, 1].map(|at| (&figures[at], &times[at * 9..][..9])) {
        let ns = |name: &str| format!("{:.1}", engine["ns_per_scan"][name].as_f64().unwrap());
        let ratio = engine["ns_per_scan"]["median"].as_f64().unwrap();
        let ratio = format!(
            "{:.2}",
            ratio
                / figures[0]["ns_per_scan"]["median"]
                    .as_f64()
                    .unwrap()
                    .min(figures[1]["ns_per_scan"]["median"].as_f64().unwrap())
        );
        let name = engine["engine"].as_str().unwrap().to_owned();
        let (median, mean, min) = (ns("median"), ns("mean"), ns("min"));
        let scans = engine["scans"].to_string();
        assert_eq!(row, [name, median, ratio, mean, min, ns("p99"), ns("p999"), ns("max"), scans]);
    }
    assert_eq!(code.len(), 14);
    for (engine, row) in [0, 1].map(|at| (&figures[at], &code[at * 7..][..7])) {
        let ns = ["frontend", "verify", "engine"].map(|stage| engine["compile_ns"][stage].as_u64().unwrap());
        let ms = [ns[0], ns[1], ns[2], ns.iter().sum()].map(|ns| format!("{:.3}", ns as f64 / 1e6));
        assert_eq!(row[1..5], ms);
        assert_eq!([row[5], row[6]], [engine["container_bytes"].to_string(), engine["code_bytes"].to_string()]);
    }
    drawings(&elements);
}

/// Two plots side by side of both engines, then for each engine its distribution and its batches over time.
fn drawings(elements: &[Element]) {
    let plots: Vec<&[Element]> = elements.split(|element| element.name == "svg").collect();
    let rects = |plot: usize| plots[plot].iter().filter(|element| element.name == "rect").collect::<Vec<_>>();
    assert_eq!(plots.len(), 7);
    for pair in [rects(0), rects(1)] {
        // The slower engine's bar is as long as a bar can be; a figure of both is to one scale.
        assert_eq!(pair.len(), 2);
        let widths = [pair[0].number("width"), pair[1].number("width")];
        assert_eq!(widths[0].max(widths[1]), 520.0);
        assert!(widths[0].min(widths[1]) > 0.0);
    }
    for (distribution, time) in [(2, 3), (4, 5)] {
        // Titles stand inside of the bars: they end first.
        let titles = plots[distribution].iter().filter(|element| element.name == "title");
        let counted: u64 = titles.map(|title| title.text.split(' ').next().unwrap().parse::<u64>().unwrap()).sum();
        assert_eq!(rects(distribution).len(), 60);
        let caption = plots[time].iter().rfind(|element| element.name == "text").unwrap();
        assert!(caption.text.ends_with(&format!("{counted} batches")) && counted >= 25, "{caption:?}, {counted}");
        assert!(!rects(time).is_empty() && rects(time).len() <= 360);
        assert!(rects(time).iter().all(|rect| rect.number("y") + rect.number("height") <= 161.0));
    }
}
