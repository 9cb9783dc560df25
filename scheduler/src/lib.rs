//! Tasks, clocks, watchdogs and statistics of Kilohertz.
