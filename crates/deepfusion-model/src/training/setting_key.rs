//! The path to one value of a configuration: names with dots between tables, indices in lists, as in `data.sets[0].learn`.

use super::nearest_key::nearest_keys;
use crate::SettingProblem;
use toml::{Table, Value};

/// A step on the path from a configuration to one of its values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Step<'a> {
    /// Into a table, by name.
    Name(&'a str),
    /// Into a list, by index, counted from 0.
    Place(usize),
}

/// Sets the value at `key`; with `None`, removes it. Missing tables on the path are created, missing elements of lists are not. Unknown
/// names are left for the caller to find when it parses the whole.
///
/// # Errors
/// If a list on the path lacks the element, or the path does not fit the configuration.
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
                        // A list may be left out if it is empty.
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
                    // There is nothing to remove, and no table is created for it.
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

/// What is wrong with a value set at `key`, from the error of parsing the whole: the key does not exist, or the value is invalid.
pub(super) fn problem(key: &str, error: toml::de::Error) -> SettingProblem {
    // The words of serde's message.
    let is_unknown = error.message().starts_with("unknown field");
    match steps(key) {
        Ok(steps) if is_unknown && known(&steps).is_none() => no_such_key(&steps),
        _ => SettingProblem::Value(error.into()),
    }
}

/// The key does not exist; with suggestions.
fn no_such_key(way: &[Step<'_>]) -> SettingProblem {
    let any_place = text(way, |_| "[]".to_owned());
    let nearest = nearest_keys(&any_place, &crate::config_keys());
    let nearest = nearest.into_iter().map(|key| with_places(key, way));
    SettingProblem::NoSuchKey {
        key: written(way),
        nearest: nearest.collect(),
    }
}

/// A key with the path's indices in its lists.
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

/// A name is used where a list needs an index.
fn name_in_list(way: &[Step<'_>], length: usize) -> SettingProblem {
    let key = written(way);
    if length == 0 {
        SettingProblem::NameInEmptyList { key }
    } else {
        SettingProblem::NameInList { key, length }
    }
}

/// A path as text, with its indices.
fn written(way: &[Step<'_>]) -> String {
    text(way, |place| format!("[{place}]"))
}

/// What kind of value a key has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum KeyKind {
    Table,
    List,
    Value,
}

/// The kind of the key at this path, if it exists.
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
    // Tables are not listed as keys.
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

    fn message(key: &str, value: Option<Value>) -> String {
        let mut config = config();
        put(&mut config, key, value).unwrap_err().to_string()
    }

    #[test]
    fn one_element_of_a_list_can_be_set() {
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
    fn a_missing_optional_value_can_be_removed() {
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
            message("assumed_camera.hfov", None),
            "unknown key `assumed_camera.hfov`: did you mean `assumed_camera.hfov_deg`?"
        );
    }

    #[test]
    fn an_index_beyond_the_end_is_refused_with_the_lists_length() {
        let value = || Some(Value::Integer(1));
        assert_eq!(
            message("data.sets[2].learn", value()),
            "there is no `data.sets[2]`: the list has 2 elements, numbered from 0"
        );
        assert_eq!(
            message("frames[7]", None),
            "there is no `frames[7]`: the list has 2 elements, numbered from 0"
        );
        // An empty list is left out.
        assert_eq!(
            message("augmentation.sizes[0].width", value()),
            "there is no `augmentation.sizes[0]`: the list has 0 elements, numbered from 0"
        );
        assert_eq!(
            message("augmentation.seizes[0].width", value()),
            "unknown key `augmentation.seizes[0].width`: did you mean `augmentation.sizes[0].width`?"
        );
    }

    #[test]
    fn indices_need_a_list_and_names_a_table() {
        let value = || Some(Value::Integer(1));
        assert_eq!(message("data[0].camera", value()), "`data` is not a list");
        assert_eq!(message("batch[0]", value()), "`batch` is not a list");
        assert_eq!(
            message("data.sets.name", value()),
            "`data.sets` is a list of 2 elements: name one, such as data.sets[0]"
        );
        assert_eq!(
            message("augmentation.sizes.width", value()),
            "`augmentation.sizes` is an empty list: set the whole list first"
        );
        assert_eq!(
            message("assumed_camera[0]", value()),
            "`assumed_camera` is not a list"
        );
        assert_eq!(
            message("data.camera.name", value()),
            "`data.camera` is a value, not a table"
        );
        assert_eq!(
            message("frames[0]", None),
            "`frames[0]` is one element of a list: set the whole list instead"
        );
    }

    #[test]
    fn an_index_is_a_number_in_brackets() {
        for key in [
            "frames[one]",
            "frames[-1]",
            "frames[]",
            "frames[*]",
            "frames[0",
            "frames[0]x",
        ] {
            let problem = message(key, Some(Value::Integer(1)));
            assert_eq!(
                problem,
                format!(
                    "`{key}`: an element of a list is named by a number in brackets, such as [0]"
                )
            );
        }
    }
}
