//! The way to one value of a configuration: names with dots between tables, places in lists, as in `data.sets[0].learn`.

use super::nearest_key::nearest_keys;
use crate::SettingProblem;
use toml::{Table, Value};

/// A step on the way from a configuration to one of its values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Step<'a> {
    /// Into a table.
    Name(&'a str),
    /// Into a list, counted from 0.
    Place(usize),
}

/// Puts a value where `key` says; without one, takes away what is there. Tables on the way to a value are made where they are missing, elements
/// of lists are not. A name that no configuration has is left to whoever reads the whole.
///
/// # Errors
/// Where there is no such place.
pub(super) fn put(
    config: &mut Value,
    key: &str,
    value: Option<Value>,
) -> Result<(), SettingProblem> {
    let steps = steps(key)?;
    let no_such_key = || no_such_key(&steps);
    let mut at = config;
    for (done, step) in steps.iter().enumerate() {
        let (way, next) = (&steps[..done], steps.get(done + 1));
        at = match (*step, next) {
            (Step::Name(name), Some(next)) => {
                let table = table(at, way)?;
                if !table.contains_key(name) {
                    let here = &steps[..=done];
                    match (known(here), *next) {
                        // A list without elements may be left out.
                        (Some(KeyKind::List), Step::Place(place)) => {
                            return Err(SettingProblem::BeyondList {
                                key: written(here),
                                place,
                                length: 0,
                            });
                        }
                        (Some(KeyKind::List), Step::Name(_)) => return Err(name_in_list(here, 0)),
                        (Some(_), Step::Place(_)) => {
                            return Err(SettingProblem::NoList { key: written(here) });
                        }
                        (None, Step::Place(_)) => return Err(no_such_key()),
                        _ => {}
                    }
                    // Nothing is there to be taken away, and no table is made for it.
                    if value.is_none() {
                        return known(&steps).map(|_| ()).ok_or_else(no_such_key);
                    }
                }
                let missing = || Value::Table(Table::new());
                table.entry(name).or_insert_with(missing)
            }
            (Step::Place(place), Some(_)) => element(at, place, way)?,
            (Step::Name(name), None) => {
                let table = table(at, way)?;
                let Some(value) = value else {
                    let was_there = table.remove(name).is_some();
                    return if was_there || known(&steps).is_some() {
                        Ok(())
                    } else {
                        Err(no_such_key())
                    };
                };
                table.insert(name.to_owned(), value);
                return Ok(());
            }
            (Step::Place(place), None) => {
                let element = element(at, place, way)?;
                *element = value.ok_or_else(|| SettingProblem::ElementOfList {
                    key: key.to_owned(),
                })?;
                return Ok(());
            }
        };
    }
    Ok(())
}

/// What is wrong with a value that was put where `key` says, by the error of whoever read the whole: that there is no such key, or the value.
pub(super) fn problem(key: &str, error: toml::de::Error) -> SettingProblem {
    // serde's words.
    let is_unknown = error.message().starts_with("unknown field");
    match steps(key) {
        Ok(steps) if is_unknown && known(&steps).is_none() => no_such_key(&steps),
        _ => SettingProblem::Value(error.into()),
    }
}

/// That nothing has this name, and what may have been meant.
fn no_such_key(way: &[Step<'_>]) -> SettingProblem {
    let any_place = text(way, |_| "[]".to_owned());
    let nearest = nearest_keys(&any_place, &crate::config_keys());
    let nearest = nearest.into_iter().map(|key| with_places(key, way));
    SettingProblem::NoSuchKey {
        key: written(way),
        nearest: nearest.collect(),
    }
}

/// A key with the places of a way in its lists.
fn with_places(key: String, way: &[Step<'_>]) -> String {
    way.iter().fold(key, |key, step| match step {
        Step::Place(place) => key.replacen("[]", &format!("[{place}]"), 1),
        Step::Name(_) => key,
    })
}

fn steps(key: &str) -> Result<Vec<Step<'_>>, SettingProblem> {
    let mut steps = Vec::new();
    for part in key.split('.') {
        let (name, mut places) = part.split_at(part.find('[').unwrap_or(part.len()));
        steps.push(Step::Name(name));
        while !places.is_empty() {
            let place = places.strip_prefix('[').and_then(|p| p.split_once(']'));
            let place = place.and_then(|(place, rest)| Some((place.parse::<usize>().ok()?, rest)));
            let (place, rest) = place.ok_or_else(|| SettingProblem::NoPlace {
                part: part.to_owned(),
            })?;
            steps.push(Step::Place(place));
            places = rest;
        }
    }
    Ok(steps)
}

fn table<'a>(at: &'a mut Value, way: &[Step<'_>]) -> Result<&'a mut Table, SettingProblem> {
    match at {
        Value::Table(table) => Ok(table),
        Value::Array(list) => Err(name_in_list(way, list.len())),
        _ => Err(SettingProblem::NoTable { key: written(way) }),
    }
}

fn element<'a>(
    at: &'a mut Value,
    place: usize,
    way: &[Step<'_>],
) -> Result<&'a mut Value, SettingProblem> {
    let Value::Array(list) = at else {
        return Err(SettingProblem::NoList { key: written(way) });
    };
    let length = list.len();
    list.get_mut(place)
        .ok_or_else(|| SettingProblem::BeyondList {
            key: written(way),
            place,
            length,
        })
}

/// A name where a list has places.
fn name_in_list(way: &[Step<'_>], length: usize) -> SettingProblem {
    let key = written(way);
    if length == 0 {
        SettingProblem::NameInEmptyList { key }
    } else {
        SettingProblem::NameInList { key, length }
    }
}

/// A way as it is written, with its places.
fn written(way: &[Step<'_>]) -> String {
    text(way, |place| format!("[{place}]"))
}

/// What a configuration may have in a place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum KeyKind {
    Table,
    List,
    Value,
}

/// What a configuration may have there, if anything.
fn known(way: &[Step<'_>]) -> Option<KeyKind> {
    let key = text(way, |_| "[]".to_owned());
    let keys = crate::config_keys();
    if let Some(known) = keys.iter().find(|known| known.key == key) {
        let is_list = known.kind.starts_with("list");
        return Some(if is_list {
            KeyKind::List
        } else {
            KeyKind::Value
        });
    }
    // Tables are no keys of their own.
    let is_table = keys.iter().any(|known| known.table() == key);
    is_table.then_some(KeyKind::Table)
}

fn text(way: &[Step<'_>], place: impl Fn(usize) -> String) -> String {
    let mut text = String::new();
    for step in way {
        match *step {
            Step::Name(name) => {
                if !text.is_empty() {
                    text.push('.');
                }
                text.push_str(name);
            }
            Step::Place(number) => text.push_str(&place(number)),
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn config() -> Value {
        let text = "batch = 4\nframes = [-1, 1]\n[data]\ncamera = \"2\"\n[[data.sets]]\nname = \"a\"\n[[data.sets]]\nname = \"b\"\n";
        Value::Table(toml::from_str(text).unwrap())
    }

    fn said(key: &str, value: Option<Value>) -> String {
        let mut config = config();
        put(&mut config, key, value).unwrap_err().to_string()
    }

    #[test]
    fn an_element_of_a_list_is_set_alone() {
        let mut set = config();
        put(&mut set, "frames[1]", Some(Value::Integer(2))).unwrap();
        put(&mut set, "data.sets[1].learn", Some("depth".into())).unwrap();
        put(&mut set, "data.sets[0].name", Some("c".into())).unwrap();
        let expected = "batch = 4\nframes = [-1, 2]\n[data]\ncamera = \"2\"\n[[data.sets]]\nname = \"c\"\n[[data.sets]]\nname = \"b\"\nlearn = \"depth\"\n";
        assert_eq!(set, Value::Table(toml::from_str(expected).unwrap()));
        put(&mut set, "data.sets[1].learn", None).unwrap();
        assert_eq!(set["data"]["sets"][1].get("learn"), None);
    }

    #[test]
    fn what_is_optional_and_not_there_can_be_taken_away() {
        let mut same = config();
        for key in [
            "data.sets[0].range",
            "data.sets[0].range.min_m",
            "assumed_camera",
            "assumed_camera.hfov_deg",
            "depth_net.disp_net.base_width",
        ] {
            put(&mut same, key, None).unwrap();
            assert_eq!(same, config(), "{key}");
        }
        assert_eq!(
            said("assumed_camera.hfov", None),
            "there is no key `assumed_camera.hfov`: did you mean `assumed_camera.hfov_deg`?"
        );
    }

    #[test]
    fn a_place_beyond_the_end_says_how_long_the_list_is() {
        let value = || Some(Value::Integer(1));
        assert_eq!(
            said("data.sets[2].learn", value()),
            "there is no `data.sets[2]`: the list has 2 elements, counted from 0"
        );
        assert_eq!(
            said("frames[7]", None),
            "there is no `frames[7]`: the list has 2 elements, counted from 0"
        );
        // It is left out where it is empty.
        assert_eq!(
            said("augmentation.sizes[0].width", value()),
            "there is no `augmentation.sizes[0]`: the list has 0 elements, counted from 0"
        );
        assert_eq!(
            said("augmentation.seizes[0].width", value()),
            "there is no key `augmentation.seizes[0].width`: did you mean `augmentation.sizes[0].width`?"
        );
    }

    #[test]
    fn places_belong_to_lists_and_names_to_tables() {
        let value = || Some(Value::Integer(1));
        assert_eq!(said("data[0].camera", value()), "`data` is no list");
        assert_eq!(said("batch[0]", value()), "`batch` is no list");
        assert_eq!(
            said("data.sets.name", value()),
            "`data.sets` is a list of 2 elements: say which, such as data.sets[0]"
        );
        assert_eq!(
            said("augmentation.sizes.width", value()),
            "`augmentation.sizes` is a list without elements: it is set as a whole first"
        );
        assert_eq!(
            said("assumed_camera[0]", value()),
            "`assumed_camera` is no list"
        );
        assert_eq!(
            said("data.camera.name", value()),
            "`data.camera` is a value and no table"
        );
        assert_eq!(
            said("frames[0]", None),
            "`frames[0]` is an element of a list, which can only be set anew without it"
        );
    }

    #[test]
    fn a_place_is_a_number_in_brackets() {
        for key in [
            "frames[one]",
            "frames[-1]",
            "frames[]",
            "frames[*]",
            "frames[0",
            "frames[0]x",
        ] {
            let problem = said(key, Some(Value::Integer(1)));
            assert_eq!(
                problem,
                format!("`{key}`: a place in a list is a number in brackets, such as [0]")
            );
        }
    }
}
