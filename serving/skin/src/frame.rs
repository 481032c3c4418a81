//! One time step of all taxels.

/// One time step of the skin, 750 per second.
///
/// # Example
/// ```
/// use tactnet_skin::Frame;
///
/// let taxels = [0.0, 12.0, 8.0, 0.0];
/// let frame = Frame { sequence: 7, sensor_time_nanos: 9_333_333, taxels: &taxels };
/// assert_eq!(frame.taxels.len(), 4);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame<'a> {
    /// Number of the frame since the sensor started; a gap is a lost frame.
    pub sequence: u64,
    /// Measurement time by the sensor's clock, in ns.
    pub sensor_time_nanos: u64,
    /// `[rows * cols]`: the values, in digits.
    pub taxels: &'a [f32],
}
