//! The native-code engine of Kilohertz.
