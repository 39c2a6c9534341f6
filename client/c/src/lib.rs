//! The client for C and C++: `include/inekf.h` is its documentation, `example/reader.c` its use.
//!
//! Handles are boxes given away as raw pointers; every function takes them as the header promises: made by the function
//! that opens, not closed yet, used by one thread at a time. A failure is kept as text for the thread.

use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char, c_int};
use std::fmt::Display;
use std::ptr;

use inekf_client::dataset::{ImuRow, PositionRow, VelocityRow};
use inekf_client::feed::{Feeder, SendError};
use inekf_client::read::EstimateReader;
use inekf_shared::message::EstimateSe23;
use inekf_shared::topic::Instance;
use inekf_shared::transport::Received;

thread_local! {
    static LAST_ERROR: RefCell<CString> = RefCell::default();
}

/// Keeps why a call failed.
fn fail(error: impl Display) {
    // A zero byte inside the text would cut it off.
    let text = error.to_string().replace('\0', " ");
    LAST_ERROR.set(CString::new(text).unwrap_or_default());
}

/// Why the last call of this thread failed.
#[unsafe(no_mangle)]
pub extern "C" fn inekf_last_error() -> *const c_char {
    LAST_ERROR.with_borrow(|text| text.as_ptr())
}

/// Reads the estimates of one daemon.
pub struct InekfReader {
    // Before the subscriber: a sample is given back to it.
    held: Option<Received<EstimateSe23>>,
    estimates: EstimateReader,
}

/// Opens a reader.
///
/// # Safety
/// `instance` is null or a string that ends with a zero.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn inekf_reader_open(instance: *const c_char) -> *mut InekfReader {
    // SAFETY: the caller's promise is handed on.
    let opened = unsafe { name(instance) }.and_then(|instance| {
        Some(InekfReader {
            held: None,
            estimates: EstimateReader::open(&instance).map_err(fail).ok()?,
        })
    });
    opened.map_or(ptr::null_mut(), |reader| Box::into_raw(Box::new(reader)))
}

/// The next estimate in shared memory, or null.
///
/// # Safety
/// `reader` is null or open, `failed` is null or a place for an int.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn inekf_reader_next(
    reader: *mut InekfReader,
    failed: *mut c_int,
) -> *const EstimateSe23 {
    // SAFETY: null, or a box of `inekf_reader_open` that nobody else uses now.
    let outcome = match unsafe { reader.as_mut() } {
        None => Err("the reader is NULL".to_owned()),
        Some(reader) => {
            reader.held = None;
            reader
                .estimates
                .borrow_next()
                .map(|sample| match sample {
                    None => ptr::null(),
                    Some(sample) => ptr::from_ref(reader.held.insert(sample).payload()),
                })
                .map_err(|error| error.to_string())
        }
    };
    let (estimate, wrong) = match outcome {
        Ok(estimate) => (estimate, 0),
        Err(error) => {
            fail(error);
            (ptr::null(), 1)
        }
    };
    // SAFETY: null, or a place for an int.
    if let Some(failed) = unsafe { failed.as_mut() } {
        *failed = wrong;
    }
    estimate
}

/// Closes a reader.
///
/// # Safety
/// `reader` is null or open, and is not used again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn inekf_reader_close(reader: *mut InekfReader) {
    if !reader.is_null() {
        // SAFETY: a box of `inekf_reader_open`, given back once.
        drop(unsafe { Box::from_raw(reader) });
    }
}

/// Sends samples to one daemon.
pub struct InekfFeeder(Feeder);

/// Opens a feeder.
///
/// # Safety
/// `instance` is null or a string that ends with a zero.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn inekf_feeder_open(instance: *const c_char) -> *mut InekfFeeder {
    // SAFETY: the caller's promise is handed on.
    let opened =
        unsafe { name(instance) }.and_then(|instance| Feeder::open(&instance).map_err(fail).ok());
    opened.map_or(ptr::null_mut(), |feeder| {
        Box::into_raw(Box::new(InekfFeeder(feeder)))
    })
}

/// Sends an IMU sample.
///
/// # Safety
/// `feeder` is null or open, the others are null or three doubles.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn inekf_feeder_imu(
    feeder: *mut InekfFeeder,
    stamp_ns: u64,
    gyro_rps: *const [f64; 3],
    accel_mps2: *const [f64; 3],
) -> c_int {
    let send = |feeder: &mut Feeder, gyro_rps, accel_mps2| {
        feeder.imu(&ImuRow {
            stamp_ns,
            gyro_rps,
            accel_mps2,
        })
    };
    // SAFETY: the caller's promise is handed on.
    unsafe { feed(feeder, gyro_rps, accel_mps2, send) }
}

/// Sends a position fix.
///
/// # Safety
/// As [`inekf_feeder_imu`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn inekf_feeder_position(
    feeder: *mut InekfFeeder,
    stamp_ns: u64,
    source: u32,
    position_w_m: *const [f64; 3],
    sigma_m: *const [f64; 3],
) -> c_int {
    let send = |feeder: &mut Feeder, position_w_m, sigma_m| {
        feeder.position(&PositionRow {
            stamp_ns,
            source,
            dimension: 3,
            position_w_m,
            sigma_m,
        })
    };
    // SAFETY: the caller's promise is handed on.
    unsafe { feed(feeder, position_w_m, sigma_m, send) }
}

/// Sends a velocity fix.
///
/// # Safety
/// As [`inekf_feeder_imu`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn inekf_feeder_velocity(
    feeder: *mut InekfFeeder,
    stamp_ns: u64,
    source: u32,
    velocity_w_mps: *const [f64; 3],
    sigma_mps: *const [f64; 3],
) -> c_int {
    let send = |feeder: &mut Feeder, velocity_w_mps, sigma_mps| {
        feeder.velocity(&VelocityRow {
            stamp_ns,
            source,
            velocity_w_mps,
            sigma_mps,
        })
    };
    // SAFETY: the caller's promise is handed on.
    unsafe { feed(feeder, velocity_w_mps, sigma_mps, send) }
}

/// Closes a feeder.
///
/// # Safety
/// `feeder` is null or open, and is not used again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn inekf_feeder_close(feeder: *mut InekfFeeder) {
    if !feeder.is_null() {
        // SAFETY: a box of `inekf_feeder_open`, given back once.
        drop(unsafe { Box::from_raw(feeder) });
    }
}

/// Sends two vectors; the number of daemons that got them, or -1.
///
/// # Safety
/// `feeder` is null or open, the others are null or three doubles.
unsafe fn feed(
    feeder: *mut InekfFeeder,
    first: *const [f64; 3],
    second: *const [f64; 3],
    send: impl FnOnce(&mut Feeder, [f64; 3], [f64; 3]) -> Result<usize, SendError>,
) -> c_int {
    // SAFETY: null, or a box of `inekf_feeder_open` that nobody else uses now; null, or three doubles.
    let given = unsafe { (feeder.as_mut(), first.as_ref(), second.as_ref()) };
    let (Some(InekfFeeder(feeder)), Some(first), Some(second)) = given else {
        fail("an argument is NULL");
        return -1;
    };
    match send(feeder, *first, *second) {
        Ok(receivers) => c_int::try_from(receivers).unwrap_or(c_int::MAX),
        Err(error) => {
            fail(error);
            -1
        }
    }
}

/// The instance of this name, or the reason kept why there is none.
///
/// # Safety
/// `text` is null or a string that ends with a zero.
unsafe fn name(text: *const c_char) -> Option<Instance> {
    if text.is_null() {
        fail("the name of the instance is NULL");
        return None;
    }
    // SAFETY: not null, so it ends with a zero.
    let text = unsafe { CStr::from_ptr(text) };
    Instance::new(&text.to_string_lossy()).map_err(fail).ok()
}
