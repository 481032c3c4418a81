//! One time step of all taxels.

/// What the skin sends 750 times a second.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame<'a> {
    /// Number of the frame since the sensor started; a gap is a lost frame.
    pub sequence: u64,
    /// Time of the measurement by the sensor's own clock, nanoseconds.
    pub sensor_time_nanos: u64,
    /// `[rows * cols]`, digits.
    pub taxels: &'a [f32],
}
