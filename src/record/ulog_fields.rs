//! The fields of a ULog's topics that become columns of a record, and how their samples are read.

use super::averager::STANDARD_GRAVITY;
use super::log_bytes::Scalar;
use super::log_clock::Sample;
use super::ulog_layout::Layout;

/// How a field becomes a value of the record.
#[derive(Clone, Copy)]
enum Unit {
    /// Times a constant.
    Times(f64),
    /// Times a constant, over a time in us that another field holds (an integral's length).
    Per(f64, &'static str),
    /// A burst of counts, as many as `samples` says, `dt` us apart, times `scale` and a constant.
    Burst(f64),
}

/// A field of a topic that can become a column.
pub(super) struct Wanted {
    pub(super) column: &'static str,
    pub(super) topic: &'static str,
    pub(super) field: String,
    unit: Unit,
}

/// The fields of interest, of one column the best first.
///
/// `sensor_gyro` and `sensor_gyro_fifo` are the driver's own output, averaged by no filter; `vehicle_imu` integrates it,
/// `sensor_combined` is the gyro that was in use at the moment, of whatever instance.
pub(super) fn wanted(axis: usize) -> Vec<Wanted> {
    let letter = ["x", "y", "z"].get(axis).copied().unwrap_or("z");
    let degrees = 180.0 / std::f64::consts::PI;
    let g = 1.0 / STANDARD_GRAVITY;
    let times = Unit::Times;
    let (rate, heat, accel, supply) = ("rate_out_dps", "die_degc", "accel_g", "supply_v");
    let angle = Unit::Per(degrees * 1e6, "delta_angle_dt");
    let speed = Unit::Per(g * 1e6, "delta_velocity_dt");
    let at = |name: &str| format!("{name}[{axis}]");
    let fields: [(&'static str, &'static str, String, Unit); 11] = [
        (rate, "sensor_gyro", letter.into(), times(degrees)),
        (
            rate,
            "sensor_gyro_fifo",
            letter.into(),
            Unit::Burst(degrees),
        ),
        (rate, "vehicle_imu", at("delta_angle"), angle),
        (rate, "sensor_combined", at("gyro_rad"), times(degrees)),
        (heat, "sensor_gyro", "temperature".into(), times(1.0)),
        (
            heat,
            "vehicle_imu_status",
            "temperature_gyro".into(),
            times(1.0),
        ),
        (accel, "sensor_accel", letter.into(), times(g)),
        (accel, "vehicle_imu", at("delta_velocity"), speed),
        (accel, "sensor_combined", at("accelerometer_m_s2"), times(g)),
        (supply, "system_power", "voltage5v_v".into(), times(1.0)),
        (supply, "battery_status", "voltage_v".into(), times(1.0)),
    ];
    fields
        .into_iter()
        .map(|(column, topic, field, unit)| Wanted {
            column,
            topic,
            field,
            unit,
        })
        .collect()
}

/// Where a value stands in a message.
pub(super) struct Pick {
    /// The averager's number.
    pub(super) channel: usize,
    offset: usize,
    scalar: Scalar,
    factor: f64,
    /// The field that the value is divided by.
    over: Option<(usize, Scalar)>,
    burst: Option<Burst>,
}

/// Where a burst says how it is read.
struct Burst {
    samples: (usize, Scalar),
    dt_us: (usize, Scalar),
    scale: (usize, Scalar),
    most: usize,
}

impl Pick {
    /// Adds the samples of a message.
    pub(super) fn take(&self, data: &[u8], samples: &mut Vec<Sample>) {
        let read = |place: (usize, Scalar)| place.1.read(data, place.0);
        let mut add = |value: f64, back_us: u64| {
            samples.push(Sample {
                channel: self.channel,
                value,
                back_us,
            });
        };
        let Some(burst) = &self.burst else {
            let value = read((self.offset, self.scalar)).map_or(f64::NAN, |v| v * self.factor);
            let over = self.over.and_then(read);
            return add(over.map_or(value, |over| value / over), 0);
        };
        let count = read(burst.samples).unwrap_or(0.0) as usize;
        let count = count.min(burst.most);
        let scale = read(burst.scale).unwrap_or(f64::NAN);
        let dt_us = read(burst.dt_us).filter(|dt| (0.0..1e6).contains(dt));
        for k in 0..count {
            let offset = self.offset + k * self.scalar.size();
            let counts = read((offset, self.scalar)).unwrap_or(f64::NAN);
            let back = dt_us.unwrap_or(0.0) * (count - 1 - k) as f64;
            add(counts * scale * self.factor, back as u64);
        }
    }
}

/// Where a field lies; `None` where the topic lacks it. The channel is still to be set.
pub(super) fn pick(layout: &Layout, field: &Wanted) -> Option<Pick> {
    let (factor, over, burst) = match field.unit {
        Unit::Times(factor) => (factor, None, None),
        Unit::Per(factor, time) => (factor, Some(layout.field(time)?), None),
        Unit::Burst(factor) => {
            let elements =
                (0..).take_while(|k| layout.field(&format!("{}[{k}]", field.field)).is_some());
            let burst = Burst {
                samples: layout.field("samples")?,
                dt_us: layout.field("dt")?,
                scale: layout.field("scale")?,
                most: elements.count(),
            };
            (factor, None, Some(burst))
        }
    };
    let name = match burst {
        Some(_) => format!("{}[0]", field.field),
        None => field.field.clone(),
    };
    let (offset, scalar) = layout.field(&name)?;
    Some(Pick {
        channel: 0,
        offset,
        scalar,
        factor,
        over,
        burst,
    })
}
