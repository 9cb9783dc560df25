//! Diagnostics as text for people: place, message, the line of source with carets, help.
