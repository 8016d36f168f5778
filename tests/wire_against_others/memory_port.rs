//! A serial port in memory, for a crate that wants a `serialport::SerialPort`.

use serialport::{DataBits, FlowControl, Parity, StopBits};
use std::io::{self, Read, Write};
use std::time::Duration;

/// Gives the same answer after everything that is sent.
#[derive(Default)]
pub struct MemoryPort {
    /// All bytes sent.
    pub sent: Vec<u8>,
    answer: io::Cursor<Vec<u8>>,
}

impl MemoryPort {
    /// With that answer.
    pub fn answering(answer: &[u8]) -> Self {
        Self { sent: Vec::new(), answer: io::Cursor::new(answer.to_vec()) }
    }
}

impl Read for MemoryPort {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        self.answer.read(out)
    }
}

impl Write for MemoryPort {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.sent.extend_from_slice(bytes);
        self.answer.set_position(0);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// What a port in memory has no use for.
fn absent<T>() -> serialport::Result<T> {
    Err(serialport::Error::new(serialport::ErrorKind::InvalidInput, "a port in memory"))
}

#[rustfmt::skip]
impl serialport::SerialPort for MemoryPort {
    fn name(&self) -> Option<String> { None }
    fn baud_rate(&self) -> serialport::Result<u32> { Ok(1_000_000) }
    fn data_bits(&self) -> serialport::Result<DataBits> { absent() }
    fn flow_control(&self) -> serialport::Result<FlowControl> { absent() }
    fn parity(&self) -> serialport::Result<Parity> { absent() }
    fn stop_bits(&self) -> serialport::Result<StopBits> { absent() }
    fn timeout(&self) -> Duration { Duration::from_secs(5) }
    fn set_baud_rate(&mut self, _: u32) -> serialport::Result<()> { absent() }
    fn set_data_bits(&mut self, _: DataBits) -> serialport::Result<()> { absent() }
    fn set_flow_control(&mut self, _: FlowControl) -> serialport::Result<()> { absent() }
    fn set_parity(&mut self, _: Parity) -> serialport::Result<()> { absent() }
    fn set_stop_bits(&mut self, _: StopBits) -> serialport::Result<()> { absent() }
    fn set_timeout(&mut self, _: Duration) -> serialport::Result<()> { Ok(()) }
    fn write_request_to_send(&mut self, _: bool) -> serialport::Result<()> { absent() }
    fn write_data_terminal_ready(&mut self, _: bool) -> serialport::Result<()> { absent() }
    fn read_clear_to_send(&mut self) -> serialport::Result<bool> { absent() }
    fn read_data_set_ready(&mut self) -> serialport::Result<bool> { absent() }
    fn read_ring_indicator(&mut self) -> serialport::Result<bool> { absent() }
    fn read_carrier_detect(&mut self) -> serialport::Result<bool> { absent() }
    // Nothing stale to flush before sending.
    fn bytes_to_read(&self) -> serialport::Result<u32> { Ok(0) }
    fn bytes_to_write(&self) -> serialport::Result<u32> { Ok(0) }
    fn clear(&self, _: serialport::ClearBuffer) -> serialport::Result<()> { Ok(()) }
    fn try_clone(&self) -> serialport::Result<Box<dyn serialport::SerialPort>> { absent() }
    fn set_break(&self) -> serialport::Result<()> { absent() }
    fn clear_break(&self) -> serialport::Result<()> { absent() }
}
