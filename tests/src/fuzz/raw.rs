//! Messages made of bytes, and the bytes of messages.

use inekf_shared::message::Message;

/// A message made of the first bytes, and the rest; `None` if there are too few.
pub fn take<M: Message>(bytes: &[u8]) -> Option<(M, &[u8])> {
    let (own, rest) = bytes.split_at_checked(size_of::<M>())?;
    // SAFETY: a message is `#[repr(C)]` and made of integers and floats only, without padding, so any bytes are one;
    // there are as many as it has, and `read_unaligned` asks nothing of their alignment.
    let message = unsafe { own.as_ptr().cast::<M>().read_unaligned() };
    Some((message, rest))
}

/// The bytes of a message.
pub fn bytes_of<M: Message>(message: &M) -> Vec<u8> {
    // SAFETY: a message has no padding (asserted beside each), so every byte is initialised; the slice lives no longer
    // than the borrow.
    let bytes = unsafe {
        core::slice::from_raw_parts(core::ptr::from_ref(message).cast::<u8>(), size_of::<M>())
    };
    bytes.to_vec()
}

#[cfg(test)]
mod tests {
    use inekf_shared::message::{ImuSample, Zero};

    use super::*;

    #[test]
    fn a_message_comes_back_from_its_bytes() {
        let mut sample = ImuSample::ZERO;
        (sample.header.seq, sample.gyro_rps[2]) = (7, -0.5);
        let mut bytes = bytes_of(&sample);
        assert!(take::<ImuSample>(&bytes[1..]).is_none());
        bytes.push(9);
        assert_eq!(take::<ImuSample>(&bytes), Some((sample, &[9][..])));
    }
}
