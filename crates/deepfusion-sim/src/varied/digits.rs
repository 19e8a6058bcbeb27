//! Single-precision numbers as doubles with equally few digits: 0.3 stays 0.3, and does not become 0.30000001192092896.

use serde::ser::Error as _;
use serde::{Serialize, Serializer};
use serde_json::{Number, Value};

/// The double nearest to the shortest decimal that represents a number.
pub(super) fn widened(single: f32) -> f64 {
    let shortest = single.to_string();
    shortest.parse().unwrap_or(f64::from(single))
}

/// Serialises a value whose floats are all of single precision, with each of them [`widened`], so that a JSON value and a JSON text have
/// the same digits.
pub(super) fn in_few_digits<S: Serializer>(
    of: &impl Serialize,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let mut value = serde_json::to_value(of).map_err(S::Error::custom)?;
    widen(&mut value);
    value.serialize(serializer)
}

fn widen(value: &mut Value) {
    match value {
        Value::Number(number) if number.is_f64() => {
            let single = number.as_f64().unwrap_or_default() as f32;
            if let Some(in_few_digits) = Number::from_f64(widened(single)) {
                *number = in_few_digits;
            }
        }
        Value::Array(items) => items.iter_mut().for_each(widen),
        Value::Object(fields) => fields.values_mut().for_each(widen),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[derive(Serialize)]
    struct Numbers {
        share: f32,
        gains: [f32; 2],
        grain: Option<f32>,
        quality: u8,
    }

    #[derive(Serialize)]
    struct WithNumbers {
        #[serde(serialize_with = "in_few_digits")]
        part: Numbers,
    }

    #[test]
    fn a_json_value_has_the_digits_of_the_json_text() {
        let whole = WithNumbers {
            part: Numbers {
                share: 0.3,
                gains: [1.1, 2.0],
                grain: Some(0.0125),
                quality: 78,
            },
        };
        let expected = json!({
            "part": { "share": 0.3, "gains": [1.1, 2.0], "grain": 0.0125, "quality": 78 }
        });
        assert_eq!(json!(whole), expected);
        let text = serde_json::to_string(&whole).unwrap();
        assert!(text.contains("\"share\":0.3,") || text.contains("\"share\":0.3}"));
    }

    #[test]
    fn widening_changes_no_number() {
        for single in [
            0.1,
            -3.7e-5,
            16_777_216.0,
            1.0e20,
            f32::MAX,
            f32::MIN_POSITIVE,
        ] {
            assert_eq!(widened(single) as f32, single);
        }
        assert!(widened(f32::NAN).is_nan());
    }
}
