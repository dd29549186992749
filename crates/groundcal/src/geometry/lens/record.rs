//! A lens as files have it: the model's name beside its parameters under their names.

use serde::{Deserialize, Serialize};

use crate::geometry::lens::{Division, Fisheye, Lens};

/// Every parameter of any model; those of other models are left out.
#[derive(Default, Serialize, Deserialize)]
#[serde(default)]
struct Record {
    model: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    k1: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    k2: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    p1: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    p2: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    k3: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    k4: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    lambda: Option<f64>,
}

impl Record {
    fn named(&self) -> [(&'static str, Option<f64>); 7] {
        [
            ("k1", self.k1),
            ("k2", self.k2),
            ("p1", self.p1),
            ("p2", self.p2),
            ("k3", self.k3),
            ("k4", self.k4),
            ("lambda", self.lambda),
        ]
    }
}

impl From<Lens> for Record {
    fn from(lens: Lens) -> Self {
        let model = Some(lens.name().to_string());
        match lens {
            // A pinhole has the coefficients of Brown-Conrady, all zero: readers of old expect them.
            Lens::None => Self { model, ..Self::from(Lens::radial(0.0, 0.0)) },
            Lens::Radtan(radtan) => {
                let model = if radtan.is_none() { Some(Lens::None.name().to_string()) } else { model };
                let [k1, k2, p1, p2, k3] = radtan.parameters();
                let k3 = (k3 != 0.0).then_some(k3);
                Self { model, k1: Some(k1), k2: Some(k2), p1: Some(p1), p2: Some(p2), k3, ..Self::default() }
            }
            Lens::Division(division) => {
                let [lambda] = division.parameters();
                Self { model, lambda: Some(lambda), ..Self::default() }
            }
            Lens::Fisheye(fisheye) => {
                let [k1, k2, k3, k4] = fisheye.parameters().map(Some);
                Self { model, k1, k2, k3, k4, ..Self::default() }
            }
        }
    }
}

impl TryFrom<Record> for Lens {
    type Error = String;

    fn try_from(record: Record) -> Result<Self, String> {
        let given = record.named().into_iter().filter_map(|(name, value)| Some((name, value?)));
        Self::from_named(record.model.as_deref().unwrap_or("none"), given)
    }
}

impl Lens {
    /// The lens of a model's name and parameters under their names; those not given are zero. Beside `none`, coefficients of
    /// Brown-Conrady make a lens all the same.
    ///
    /// # Errors
    /// What is wrong: an unknown model, a parameter that is not finite, or one other than zero that is not of the model.
    pub fn from_named<'a>(model: &str, given: impl IntoIterator<Item = (&'a str, f64)>) -> Result<Self, String> {
        let start = match model {
            "none" | "radtan" => Self::radial(0.0, 0.0),
            "division" => Self::Division(Division::default()),
            "fisheye" => Self::Fisheye(Fisheye::default()),
            _ => return Err(format!("distortion.model is {model}: none, radtan, division or fisheye is read")),
        };
        let names = start.parameter_names();
        let mut parameters = vec![0.0; names.len()];
        for (name, value) in given {
            if !value.is_finite() {
                return Err(format!("distortion.{name} is {value}: it must be finite"));
            }
            match names.iter().position(|n| *n == name) {
                Some(at) => parameters[at] = value,
                None if value == 0.0 => {}
                None => {
                    let names = names.join(", ");
                    return Err(format!("distortion.{name} is {value}: the model {model} has {names} alone"));
                }
            }
        }
        match start.with_parameters(&parameters) {
            Some(Self::Radtan(radtan)) if model == "none" && radtan.is_none() => Ok(Self::None),
            Some(lens) => Ok(lens),
            None => Err(format!("distortion.model {model}: {} parameters", parameters.len())),
        }
    }
}

impl Serialize for Lens {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        Record::from(*self).serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for Lens {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Self::try_from(Record::deserialize(deserializer)?).map_err(serde::de::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Lens, String> {
        serde_json::from_str(text).map_err(|e| e.to_string())
    }

    #[test]
    fn what_is_not_of_the_model_is_refused() {
        assert_eq!(read(r#"{"model": "radtan", "source": "estimated", "k1": -0.1}"#), Ok(Lens::radial(-0.1, 0.0)));
        assert_eq!(read(r#"{"k1": -0.1}"#), Ok(Lens::radial(-0.1, 0.0)));
        assert_eq!(read(r#"{"model": "none", "k1": 0.0, "p1": 0.0}"#), Ok(Lens::None));
        assert_eq!(read("{}"), Ok(Lens::None));
        for (text, words) in [
            (r#"{"model": "omni", "k1": 0.1}"#, ["omni", "fisheye"]),
            (r#"{"model": "radtan", "k1": 0.1, "k4": 0.2}"#, ["k4 is 0.2", "radtan"]),
            (r#"{"model": "fisheye", "p1": 0.1}"#, ["p1 is 0.1", "k1, k2, k3, k4"]),
            (r#"{"model": "division", "k1": 0.1}"#, ["k1 is 0.1", "lambda"]),
        ] {
            let error = read(text).unwrap_err();
            assert!(words.iter().all(|w| error.contains(w)), "{error}");
        }
    }
}
