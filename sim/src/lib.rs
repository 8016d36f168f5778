//! Virtual servos at register level on virtual lines.
