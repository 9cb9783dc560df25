//! What both engines of Kilohertz must agree on.
