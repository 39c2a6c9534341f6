//! Geodetic coordinates (WGS 84) and the local world frame: east, north, up, in metres, on the plane that touches the
//! ellipsoid's normal at an origin.
//!
//! ```
//! use inekf_client::geodetic::{Geodetic, LocalFrame};
//!
//! let here = Geodetic { lat_deg: 48.8583, lon_deg: 2.2945, alt_m: 35.0 };
//! let frame = LocalFrame::new(here);
//! let east_of_it = Geodetic { lon_deg: 2.2955, ..here };
//! let [east, north, up] = frame.enu_m(east_of_it);
//! assert!((east - 73.35).abs() < 0.05 && north.abs() < 1e-3 && up.abs() < 1e-3);
//! ```
//!
//! Earth-centred coordinates: `X = (N + h) cos lat cos lon`, `Y = (N + h) cos lat sin lon`,
//! `Z = (N (1 - e^2) + h) sin lat` with `N = a / sqrt(1 - e^2 sin^2 lat)`. The way back iterates on the latitude; within
//! 100 km of the ground it is exact to less than a micrometre.
//!
//! The heights are above the ellipsoid, as receivers give them beside the height above sea level. In a frame of more
//! than some ten kilometres the plane departs from the ground: by 8 m at 10 km.

use nalgebra::{Matrix3, Vector3};

/// Semi-major axis of the ellipsoid, m.
const A_M: f64 = 6_378_137.0;
/// Flattening of the ellipsoid.
const F: f64 = 1.0 / 298.257_223_563;
/// First eccentricity, squared.
const E2: f64 = F * (2.0 - F);

/// A place by latitude, longitude and height.
///
/// ```
/// use inekf_client::geodetic::Geodetic;
///
/// // Where the equator meets the zero meridian: the semi-major axis along X.
/// let origin = Geodetic { lat_deg: 0.0, lon_deg: 0.0, alt_m: 0.0 };
/// assert_eq!(origin.ecef_m(), [6_378_137.0, 0.0, 0.0]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Geodetic {
    /// Latitude, degrees, north positive.
    pub lat_deg: f64,
    /// Longitude, degrees, east positive.
    pub lon_deg: f64,
    /// Height above the ellipsoid, m.
    pub alt_m: f64,
}

impl Geodetic {
    /// Whether it is a place: finite, latitude within 90 degrees, longitude within 360, height within 10 000 km.
    ///
    /// ```
    /// use inekf_client::geodetic::Geodetic;
    ///
    /// let place = Geodetic { lat_deg: 47.0, lon_deg: 8.0, alt_m: 400.0 };
    /// assert!(place.is_valid());
    /// assert!(!Geodetic { lat_deg: 97.0, ..place }.is_valid());
    /// assert!(!Geodetic { alt_m: f64::NAN, ..place }.is_valid());
    /// ```
    #[must_use]
    pub fn is_valid(&self) -> bool {
        self.lat_deg.abs() <= 90.0 && self.lon_deg.abs() <= 360.0 && self.alt_m.abs() <= 1e7
    }

    /// Earth-centred, earth-fixed coordinates, m.
    ///
    /// ```
    /// use inekf_client::geodetic::Geodetic;
    ///
    /// // A pole lies on the semi-minor axis, 21 km nearer to the centre than the equator.
    /// let [_, _, z_m] = Geodetic { lat_deg: 90.0, lon_deg: 0.0, alt_m: 0.0 }.ecef_m();
    /// assert!((z_m - 6_356_752.314).abs() < 1e-3);
    /// ```
    #[must_use]
    pub fn ecef_m(&self) -> [f64; 3] {
        let (sin_lat, cos_lat) = self.lat_deg.to_radians().sin_cos();
        let (sin_lon, cos_lon) = self.lon_deg.to_radians().sin_cos();
        let normal = A_M / (1.0 - E2 * sin_lat * sin_lat).sqrt();
        let from_axis = (normal + self.alt_m) * cos_lat;
        [
            from_axis * cos_lon,
            from_axis * sin_lon,
            (normal * (1.0 - E2) + self.alt_m) * sin_lat,
        ]
    }

    /// The place of earth-centred coordinates.
    ///
    /// ```
    /// use inekf_client::geodetic::Geodetic;
    ///
    /// let here = Geodetic { lat_deg: -33.9, lon_deg: 18.4, alt_m: 1085.0 };
    /// let again = Geodetic::from_ecef_m(here.ecef_m());
    /// assert!((again.lat_deg - here.lat_deg).abs() < 1e-12 && (again.alt_m - here.alt_m).abs() < 1e-6);
    /// ```
    #[must_use]
    pub fn from_ecef_m([x, y, z]: [f64; 3]) -> Self {
        let from_axis = x.hypot(y);
        let mut lat = z.atan2(from_axis * (1.0 - E2));
        // Each step gains more than two digits; from this start five reach the last one.
        for _ in 0..6 {
            let sin = lat.sin();
            let normal = A_M / (1.0 - E2 * sin * sin).sqrt();
            lat = (z + E2 * normal * sin).atan2(from_axis);
        }
        let (sin, cos) = lat.sin_cos();
        // The distance along the normal; good at the poles, too.
        let alt_m = from_axis * cos + z * sin - A_M * (1.0 - E2 * sin * sin).sqrt();
        Self {
            lat_deg: lat.to_degrees(),
            lon_deg: y.atan2(x).to_degrees(),
            alt_m,
        }
    }
}

/// A world frame: its origin and its axes.
///
/// ```
/// use inekf_client::geodetic::{Geodetic, LocalFrame};
///
/// let frame = LocalFrame::new(Geodetic { lat_deg: 52.0, lon_deg: 13.0, alt_m: 40.0 });
/// assert_eq!(frame.enu_m(frame.origin()), [0.0; 3]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalFrame {
    origin: Geodetic,
    origin_ecef_m: Vector3<f64>,
    /// From earth-centred axes to east, north, up.
    r_we: Matrix3<f64>,
}

impl LocalFrame {
    /// The frame with this origin.
    ///
    /// ```
    /// use inekf_client::geodetic::{Geodetic, LocalFrame};
    ///
    /// // A minute of latitude to the north is a nautical mile, or nearly.
    /// let origin = Geodetic { lat_deg: 45.0, lon_deg: 13.0, alt_m: 0.0 };
    /// let frame = LocalFrame::new(origin);
    /// let [_, north, _] = frame.enu_m(Geodetic { lat_deg: 45.0 + 1.0 / 60.0, ..origin });
    /// assert!((north - 1852.0).abs() < 5.0);
    /// ```
    #[must_use]
    pub fn new(origin: Geodetic) -> Self {
        let (sin_lat, cos_lat) = origin.lat_deg.to_radians().sin_cos();
        let (sin_lon, cos_lon) = origin.lon_deg.to_radians().sin_cos();
        Self {
            origin,
            origin_ecef_m: origin.ecef_m().into(),
            r_we: Matrix3::new(
                -sin_lon,
                cos_lon,
                0.0,
                -sin_lat * cos_lon,
                -sin_lat * sin_lon,
                cos_lat,
                cos_lat * cos_lon,
                cos_lat * sin_lon,
                sin_lat,
            ),
        }
    }

    /// Where the frame has its zero.
    ///
    /// ```
    /// use inekf_client::geodetic::{Geodetic, LocalFrame};
    ///
    /// let origin = Geodetic { lat_deg: 52.0, lon_deg: 13.0, alt_m: 40.0 };
    /// assert_eq!(LocalFrame::new(origin).origin(), origin);
    /// ```
    #[must_use]
    pub fn origin(&self) -> Geodetic {
        self.origin
    }

    /// A place in the frame: east, north, up, m.
    ///
    /// ```
    /// use inekf_client::geodetic::{Geodetic, LocalFrame};
    ///
    /// let here = Geodetic { lat_deg: 52.0, lon_deg: 13.0, alt_m: 40.0 };
    /// // Ten metres higher at the same place is ten metres up.
    /// let [east, north, up] = LocalFrame::new(here).enu_m(Geodetic { alt_m: 50.0, ..here });
    /// assert!(east.abs() < 1e-8 && north.abs() < 1e-8 && (up - 10.0).abs() < 1e-8);
    /// ```
    #[must_use]
    pub fn enu_m(&self, place: Geodetic) -> [f64; 3] {
        let from_origin = Vector3::from(place.ecef_m()) - self.origin_ecef_m;
        (self.r_we * from_origin).into()
    }

    /// The place of a point of the frame.
    ///
    /// ```
    /// use inekf_client::geodetic::{Geodetic, LocalFrame};
    ///
    /// let frame = LocalFrame::new(Geodetic { lat_deg: 52.0, lon_deg: 13.0, alt_m: 40.0 });
    /// let place = frame.geodetic([1000.0, -500.0, 20.0]);
    /// assert!(place.lon_deg > 13.0 && place.lat_deg < 52.0);
    /// let [east, north, up] = frame.enu_m(place);
    /// assert!((east - 1000.0).abs() < 1e-6 && (north + 500.0).abs() < 1e-6 && (up - 20.0).abs() < 1e-6);
    /// ```
    #[must_use]
    pub fn geodetic(&self, enu_m: [f64; 3]) -> Geodetic {
        let ecef = self.origin_ecef_m + self.r_we.transpose() * Vector3::from(enu_m);
        Geodetic::from_ecef_m(ecef.into())
    }
}
