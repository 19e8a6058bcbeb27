//! The names of a model's classes.

/// COCO's eighty classes in the order that detectors number them.
const COCO: &str = "person,bicycle,car,motorcycle,airplane,bus,train,truck,boat,traffic light,fire hydrant,stop sign,parking \
meter,bench,bird,cat,dog,horse,sheep,cow,elephant,bear,zebra,giraffe,backpack,umbrella,handbag,tie,suitcase,frisbee,skis,\
snowboard,sports ball,kite,baseball bat,baseball glove,skateboard,surfboard,tennis racket,bottle,wine glass,cup,fork,knife,\
spoon,bowl,banana,apple,sandwich,orange,broccoli,carrot,hot dog,pizza,donut,cake,chair,couch,potted plant,bed,dining \
table,toilet,tv,laptop,mouse,remote,keyboard,cell phone,microwave,oven,toaster,sink,refrigerator,book,clock,vase,scissors,\
teddy bear,hair drier,toothbrush";

/// The names in a model's metadata, such as `{0: 'car', 1: "driver's cab"}`, in the order of their numbers; `None` for any other text.
pub(crate) fn of_note(note: &str) -> Option<Vec<String>> {
    let mut rest = note.trim().strip_prefix('{')?.strip_suffix('}')?.trim();
    let mut names: Vec<String> = Vec::new();
    while !rest.is_empty() {
        let (number, after) = rest.split_once(':')?;
        let number: usize = number.trim().trim_matches(['\'', '"']).parse().ok()?;
        let after = after.trim_start();
        let quote = after.chars().next().filter(|c| matches!(c, '\'' | '"'))?;
        let (name, after) = after[1..].split_once(quote)?;
        if number > 100_000 {
            return None;
        }
        if names.len() <= number {
            names.resize(number + 1, String::new());
        }
        names[number] = name.to_owned();
        rest = after.trim_start().trim_start_matches(',').trim_start();
    }
    Some(names)
}

/// The name of class `number` of `classes`: the model's own, COCO's if there are eighty, otherwise its number.
pub(crate) fn name_of(own: &[String], classes: usize, number: usize) -> String {
    let own = own.get(number).filter(|name| !name.is_empty()).cloned();
    let coco = || (classes == 80).then(|| COCO.split(',').nth(number).map(str::to_owned));
    own.or_else(|| coco().flatten())
        .unwrap_or_else(|| format!("class {number}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_parsed_from_the_metadata() {
        let names = of_note("{0: 'car', 2: \"driver's cab\"}").unwrap();
        assert_eq!(names, ["car", "", "driver's cab"]);
        assert_eq!(of_note("{}"), Some(Vec::new()));
        for broken in [
            "",
            "['car']",
            "{0: car}",
            "{x: 'car'}",
            "{0: 'car",
            "{99999999999: 'a'}",
        ] {
            assert_eq!(of_note(broken), None, "{broken}");
        }
        assert_eq!(name_of(&names, 80, 2), "driver's cab");
        assert_eq!(name_of(&names, 80, 1), "bicycle");
        assert_eq!(name_of(&[], 80, 79), "toothbrush");
        assert_eq!(name_of(&[], 3, 1), "class 1");
    }
}
