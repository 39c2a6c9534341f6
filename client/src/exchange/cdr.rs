//! Common Data Representation, little endian: what ROS 2 messages are on the wire (OMG DDSI-RTPS 10.2, "CDR_LE").
//!
//! Four octets say so; after them every number is aligned to its own size, counted from there. A string is its length
//! with the closing zero, its octets, and the zero.

/// A message under construction.
pub struct Cdr {
    bytes: Vec<u8>,
}

/// Octets before the body.
const HEAD: [u8; 4] = [0, 1, 0, 0];

impl Cdr {
    /// An empty message.
    pub fn new() -> Self {
        Self {
            bytes: HEAD.to_vec(),
        }
    }

    fn align(&mut self, to: usize) {
        while !(self.bytes.len() - HEAD.len()).is_multiple_of(to) {
            self.bytes.push(0);
        }
    }

    /// A 32-bit integer.
    pub fn u32(&mut self, value: u32) {
        self.align(4);
        self.bytes.extend(value.to_le_bytes());
    }

    /// A double.
    pub fn f64(&mut self, value: f64) {
        self.align(8);
        self.bytes.extend(value.to_le_bytes());
    }

    /// Doubles one after the other, without a count: an array of fixed length.
    pub fn f64s(&mut self, values: impl IntoIterator<Item = f64>) {
        for value in values {
            self.f64(value);
        }
    }

    /// A string.
    pub fn string(&mut self, text: &str) {
        self.u32(u32::try_from(text.len() + 1).unwrap_or(u32::MAX));
        self.bytes.extend(text.as_bytes());
        self.bytes.push(0);
    }

    /// The octets.
    pub fn finish(self) -> Vec<u8> {
        self.bytes
    }
}
