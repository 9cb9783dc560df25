//! What self-contained HTML pages share: no script, no link to elsewhere.

const STYLE: &str = "body{font:15px/1.5 system-ui,sans-serif;max-width:820px;margin:2em auto;padding:0 1em;color:#222}\
table{border-collapse:collapse;margin:1em 0}td,th{padding:.3em .8em;text-align:right;border-bottom:1px solid #ddd}\
td:first-child,th:first-child{text-align:left}svg{background:#fafafa;border:1px solid #ddd}rect{fill:#3b6ea5}text{font-size:11px;fill:#555}";

/// What every page ends with.
pub const END: &str = "</body></html>";

/// The begin of a page; `style` is CSS of its own, `heading` is HTML.
pub fn head(title: &str, style: &str, heading: &str) -> String {
    format!(
        "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"/><title>{title}</title><style>{STYLE}{style}</style></head><body><h1>{heading}</h1>"
    )
}

/// Text as HTML, also inside of attributes.
pub fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
