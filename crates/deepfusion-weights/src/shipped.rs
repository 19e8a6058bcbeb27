use std::borrow::Cow;
use std::path::{Path, PathBuf};

use deepfusion_fs::{publish_all, write_aside};
use sha2::{Digest, Sha256};

use crate::scan::is_name;
use crate::{Card, CardProblem, Error};

/// The default network.
pub const DEFAULT: &str = "street";

/// Largest size of an embedded network's weights, in bytes.
pub const MAX_BYTES: u64 = 32_000_000;

/// A packed network: its card and its weights.
#[derive(Debug, Clone, PartialEq)]
pub struct Shipped {
    /// The description of the network.
    pub card: Card,
    /// The content of a safetensors file.
    pub bytes: Cow<'static, [u8]>,
}

/// An embedded network, as found by the build script.
struct Embedded {
    name: &'static str,
    card: &'static str,
    weights: &'static [u8],
}

static EMBEDDED: &[Embedded] = include!(concat!(env!("OUT_DIR"), "/embedded.rs"));

/// Names of the embedded networks, in order.
pub fn names() -> impl Iterator<Item = &'static str> {
    EMBEDDED.iter().map(|network| network.name)
}

/// The embedded networks, by name.
///
/// # Errors
/// [`Error::Card`], [`Error::Version`] for an embedded card that this program cannot read.
pub fn all() -> Result<Vec<Shipped>, Error> {
    EMBEDDED.iter().map(Shipped::embedded).collect()
}

/// The embedded network with the given name.
///
/// # Errors
/// [`Error::NotEmbedded`] with the available names; otherwise those of [`all`].
pub fn find(name: &str) -> Result<Shipped, Error> {
    match EMBEDDED.iter().find(|network| network.name == name) {
        Some(network) => Shipped::embedded(network),
        None => Err(Error::NotEmbedded {
            name: name.to_owned(),
            known: names().map(str::to_owned).collect(),
        }),
    }
}

impl Shipped {
    fn embedded(network: &Embedded) -> Result<Self, Error> {
        let card = Card::parse(network.name, network.card)?;
        Self::named(network.name, card, Cow::Borrowed(network.weights))
    }

    /// The card must have the name of its file: a network is found by the one and shown by the other.
    fn named(origin: &str, card: Card, bytes: Cow<'static, [u8]>) -> Result<Self, Error> {
        if card.name != origin {
            return Err(Error::Card {
                origin: origin.to_owned(),
                reason: CardProblem::OfAnother { name: card.name },
            });
        }
        Ok(Self { card, bytes })
    }

    /// Whether a file may be packed weights: `NAME.safetensors` with `NAME.toml` beside it.
    #[must_use]
    pub fn is_at(path: &Path) -> bool {
        let ending = path.extension().is_some_and(|e| e == "safetensors");
        ending && path.is_file() && path.with_extension("toml").is_file()
    }

    /// Reads `NAME.safetensors` and the card beside it, and checks that they belong together.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Card`], [`Error::Version`], [`Error::OtherWeights`].
    pub fn read(path: &Path) -> Result<Self, Error> {
        let card = path.with_extension("toml");
        let text = std::fs::read_to_string(&card).map_err(Error::io(&card, "read"))?;
        let card = Card::parse(&card.display().to_string(), &text)?;
        let bytes = std::fs::read(path).map_err(Error::io(path, "read"))?;
        let found = sha256(&bytes);
        if found != card.sha256 {
            return Err(Error::OtherWeights {
                path: path.to_owned(),
                found,
                expected: card.sha256,
            });
        }
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        Self::named(&name, card, Cow::Owned(bytes))
    }

    /// A network with this card and these weights; the card's length and digest are computed from the bytes.
    ///
    /// # Errors
    /// [`Error::Name`] for an invalid name.
    pub fn new(mut card: Card, bytes: Vec<u8>) -> Result<Self, Error> {
        if !is_name(&card.name) {
            return Err(Error::Name { name: card.name });
        }
        (card.sha256, card.bytes) = (sha256(&bytes), bytes.len() as u64);
        let bytes = Cow::Owned(bytes);
        Ok(Self { card, bytes })
    }

    /// Paths of a network's two files in a folder: the card, the weights.
    #[must_use]
    pub fn paths(folder: &Path, name: &str) -> [PathBuf; 2] {
        [".toml", ".safetensors"].map(|ending| folder.join(format!("{name}{ending}")))
    }

    /// Writes both files into a folder, which is created if necessary. They get their final names when both are on disk. Returns their
    /// paths, the card's first.
    ///
    /// # Errors
    /// [`Error::Exists`] if one of them already exists, unless `replace` is set; [`Error::Io`].
    pub fn write(&self, folder: &Path, replace: bool) -> Result<[PathBuf; 2], Error> {
        use std::io::Write;
        let text = self.card.to_toml()?;
        let paths = Self::paths(folder, &self.card.name);
        if let Some(path) = paths.iter().find(|path| !replace && path.exists()) {
            return Err(Error::Exists { path: path.clone() });
        }
        std::fs::create_dir_all(folder).map_err(Error::io(folder, "write"))?;
        let aside = |path: &Path, content: &[u8]| {
            let failed = Error::io(path, "write");
            write_aside(path, &failed, |out| out.write_all(content).map_err(&failed))
        };
        let [card, weights] = &paths;
        let partials = vec![aside(weights, &self.bytes)?, aside(card, text.as_bytes())?];
        publish_all(partials).map_err(Error::io(folder, "write"))?;
        Ok(paths)
    }
}

/// SHA-256 in hexadecimal digits.
fn sha256(bytes: &[u8]) -> String {
    format!("{:x}", Sha256::digest(bytes))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::card::tests::card;
    use crate::scan::{list, scan};
    use crate::{Tensor, pack};
    use deepfusion_hint::Hint;

    fn street() -> Shipped {
        let tensor = Tensor {
            name: "encoder.conv1.weight",
            shape: &[1, 1, 2, 2],
            values: &[0.5, -1.0, 2.0, 0.25],
        };
        Shipped::new(card("street"), pack(&[tensor]).unwrap()).unwrap()
    }

    #[test]
    fn written_networks_are_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("new");
        let network = street();
        let [card, weights] = network.write(&out, false).unwrap();
        assert!(Shipped::is_at(&weights) && !Shipped::is_at(&card));
        assert_eq!(Shipped::read(&weights).unwrap(), network);
        // The well-known SHA-256 of no bytes.
        assert_eq!(
            sha256(b""),
            "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855"
        );
        // Writing again gives the same bytes, and only if replacing is allowed.
        let before = [&card, &weights].map(|path| std::fs::read(path).unwrap());
        assert!(matches!(
            network.write(&out, false),
            Err(Error::Exists { .. })
        ));
        network.write(&out, true).unwrap();
        let after = [&card, &weights].map(|path| std::fs::read(path).unwrap());
        assert_eq!(before, after);
        let left = std::fs::read_dir(&out).unwrap().count();
        assert_eq!(left, 2, "no temporary file is left");
    }

    #[test]
    fn weights_of_another_card_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let [card, weights] = street().write(folder.path(), false).unwrap();
        let mut bytes = std::fs::read(&weights).unwrap();
        *bytes.last_mut().unwrap() ^= 1;
        std::fs::write(&weights, bytes).unwrap();
        let error = Shipped::read(&weights).unwrap_err();
        assert!(matches!(error, Error::OtherWeights { .. }), "{error}");
        // If only the files are renamed, the card's name differs from theirs.
        let renamed = folder.path().join("other.safetensors");
        street().write(folder.path(), true).unwrap();
        std::fs::rename(&weights, &renamed).unwrap();
        std::fs::rename(&card, renamed.with_extension("toml")).unwrap();
        let error = Shipped::read(&renamed).unwrap_err().to_string();
        assert!(error.contains("card of `street`"), "{error}");
        std::fs::remove_file(renamed.with_extension("toml")).unwrap();
        assert!(!Shipped::is_at(&renamed));
        assert!(matches!(Shipped::read(&renamed), Err(Error::Io { .. })));
    }

    #[test]
    fn invalid_names_are_refused() {
        for bad in ["", "none", "Street", "a/b", "1st", "-x", "a b", "a.b"] {
            let error = Shipped::new(card(bad), Vec::new()).unwrap_err();
            assert!(matches!(error, Error::Name { .. }), "{bad}");
        }
        for good in ["street", "tiny", "street-2"] {
            Shipped::new(card(good), Vec::new()).unwrap();
        }
    }

    /// Does the build script's work on a temporary folder.
    #[test]
    fn a_folder_of_pairs_becomes_a_list_in_the_order_of_names() {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        assert_eq!(scan(&at.join("none")).unwrap(), []);
        assert_eq!(list(&[]).unwrap(), "&[\n]\n");
        std::fs::write(at.join("README.md"), "text").unwrap();
        std::fs::write(at.join(".street.toml.1-0.partial"), "half").unwrap();
        std::fs::write(at.join(".hidden.toml"), "half").unwrap();
        assert_eq!(scan(at).unwrap(), []);
        street().write(at, false).unwrap();
        Shipped::new(card("late"), vec![1])
            .unwrap()
            .write(at, false)
            .unwrap();
        let pairs = scan(at).unwrap();
        let found: Vec<&str> = pairs.iter().map(|pair| pair.name.as_str()).collect();
        assert_eq!(found, ["late", "street"]);
        let [card, weights] = Shipped::paths(at, "street");
        assert_eq!((&pairs[1].card, &pairs[1].weights), (&card, &weights));
        let text = list(&pairs).unwrap();
        assert_eq!(text.matches("Embedded {").count(), 2);
        let line = format!(
            "Embedded {{ name: \"street\", card: include_str!({card:?}), weights: include_bytes!({weights:?}) }},"
        );
        assert!(text.contains(&line), "{text}");
        // A card alone, weights alone, an invalid name.
        for (gone, kept) in [(&weights, "street.toml"), (&card, "street.safetensors")] {
            let content = std::fs::read(gone).unwrap();
            std::fs::remove_file(gone).unwrap();
            let error = scan(at).unwrap_err().to_string();
            assert!(error.contains(&format!("{kept} has no ")), "{error}");
            std::fs::write(gone, content).unwrap();
        }
        scan(at).unwrap();
        std::fs::write(at.join("Street 2.toml"), "").unwrap();
        let error = scan(at).unwrap_err().to_string();
        assert!(error.contains("Street 2.toml"), "{error}");
    }

    /// Checks the files in `weights/`: every embedded network matches its card.
    #[test]
    fn embedded_networks_match_their_cards() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("weights");
        let pairs = scan(&folder).unwrap();
        let there: Vec<&str> = pairs.iter().map(|pair| pair.name.as_str()).collect();
        assert_eq!(names().collect::<Vec<_>>(), there);
        let networks = all().unwrap();
        assert_eq!(networks.len(), pairs.len());
        for (network, pair) in networks.iter().zip(&pairs) {
            let card = &network.card;
            assert_eq!(Shipped::read(&pair.weights).unwrap(), *network);
            assert_eq!(card.bytes, network.bytes.len() as u64, "{}", card.name);
            assert!(card.bytes <= MAX_BYTES, "{}", card.name);
            assert_eq!(find(&card.name).unwrap(), *network);
        }
        let error = find("no-such-network").unwrap_err();
        let message = error.to_string();
        for name in names() {
            assert!(message.contains(name), "{message}");
        }
        assert!(error.hint().is_some());
    }
}
