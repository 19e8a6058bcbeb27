use deepfusion_data::to_network_input;
use deepfusion_eval::compare::sha256_of_file;
use deepfusion_infer::Precision;
use deepfusion_model::depth_graph_with_uncertainty;
use deepfusion_model::{RunFolder, StoredNetwork, TrainConfig};
use deepfusion_runtime::{DepthRunner, FusedRunner};
use deepfusion_sim::{SimConfig, Simulation};
use deepfusion_weights::{Card, FORMAT_VERSION, MAX_BYTES, NUMBERS, Shipped, Tensor, pack};

use super::figures;
use super::list::Listed;
use crate::cli::PackArgs;
use crate::commands::uncertainty;
use crate::error::CliError;
use crate::failure::{Context, Result};
use crate::output;
use crate::progress::say;

/// `deepfusion weights pack`.
pub fn run(args: &PackArgs) -> Result<()> {
    if Shipped::is_at(&args.model) {
        let path = args.model.clone();
        return Err(CliError::PackedAlready { path }.into());
    }
    let (folder, given) = RunFolder::open(&args.model)?;
    let asked = args.checkpoint.or(given);
    let kind = asked.unwrap_or_else(|| folder.preferred());
    let file = folder.checkpoint_path(kind);
    if folder.read_state(kind)?.encoders_only {
        return Err(CliError::NothingToPack { path: file }.into());
    }
    let (config, findings) = (folder.read_config()?, folder.read_findings()?);
    let (weights, state) = folder.load_depth_weights(kind)?;
    let network = StoredNetwork {
        config: config.clone(),
        camera: findings.camera,
        weights,
        step: state.step,
    };
    // All of it, and nothing else.
    depth_graph_with_uncertainty(&network.config.depth_net, network.weights.clone())?;
    let tensors = network.weights.tensors.iter();
    let tensors: Vec<Tensor> = tensors
        .map(|(name, tensor)| Tensor {
            name,
            shape: &tensor.shape,
            values: &tensor.values,
        })
        .collect();
    let bytes = pack(&tensors)?;
    let modified = std::fs::metadata(&file).and_then(|meta| meta.modified());
    let modified = modified.map_err(|e| deepfusion_data::Error::file(&file, e))?;
    let parts = config.depth_net.costs(config.size);
    let card = Card {
        format_version: FORMAT_VERSION,
        name: args.name.clone(),
        // Filled in with the bytes.
        sha256: String::new(),
        bytes: 0,
        parameters: parts.iter().map(|part| part.parameters).sum(),
        steps: state.step,
        checkpoint: kind.name().into(),
        date: output::day(modified),
        data: learned_from(&config),
        simulated_only: args.simulated_only,
        recipe: args.recipe.clone(),
        licence: args.licence.clone(),
        numbers: NUMBERS.into(),
        depth_difference: rounded(difference(&network, &bytes)?),
        note: args.note.clone(),
        figures: figures::of(folder.path(), &sha256_of_file(&file)?),
        uncertainty: uncertainty::read(folder.path())?
            .map(toml::Table::try_from)
            .transpose()
            .context("the factors of its intervals have no TOML form")?,
        config: config
            .without_places()
            .to_run_table(&findings)
            .context("the run's configuration has no TOML form")?,
    };
    let shipped = Shipped::new(card, bytes)?;
    let [card_path, weights_path] = shipped.write(&args.out, args.overwrite)?;
    let card = &shipped.card;
    say(&format!(
        "{:.1} MB, {:.2} M parameters; depth differs by at most {:.2} % from the run's, on a simulated street",
        card.bytes as f64 / 1e6,
        card.parameters as f64 / 1e6,
        100.0 * card.depth_difference,
    ));
    if card.bytes > MAX_BYTES {
        tracing::warn!(
            "{}: larger than the {} MB that are embedded at most; --model takes the file itself all the same",
            weights_path.display(),
            MAX_BYTES / 1_000_000
        );
    }
    if args.json {
        return output::print_json(&Listed::from(card));
    }
    let (card, weights) = (card_path.display(), weights_path.display());
    output::print(&format!("{weights}\n{card}\n"))
}

/// The names of the recordings that a run learned from.
fn learned_from(config: &TrainConfig) -> Vec<String> {
    let sets = config.data.sets.iter();
    let recorded = sets.clone().flat_map(|set| &set.paths);
    let simulated = sets.filter(|set| set.simulated.is_some());
    let simulated = simulated.map(|set| format!("{} (simulated views)", set.name));
    let mut names = figures::names(config.data.paths.iter().chain(recorded));
    names.extend(simulated);
    names
}

/// Largest |packed − original| / original over the depths of a simulated picture, both computed in f32.
fn difference(network: &StoredNetwork, bytes: &[u8]) -> Result<f64> {
    let config = &network.config;
    let (width, height) = (config.size.width as u32, config.size.height as u32);
    let street = Simulation::new(&SimConfig {
        frames: 1,
        width,
        height,
        ..SimConfig::default()
    })?;
    let picture = street.frame(0).rgb;
    let input = to_network_input(&picture, [0, 0, width, height], width, height);
    let depth = |weights| -> Result<Vec<f64>> {
        let mut runner = FusedRunner::new(config, weights, Precision::F32)?;
        let disparity = runner.disparity(&input)?;
        Ok(disparity
            .into_iter()
            .map(|d| f64::from(d).recip())
            .collect())
    };
    let original = depth(network.weights.clone())?;
    let packed = depth(deepfusion_model::weights::read_bytes(
        "the packed network",
        bytes,
    )?)?;
    let relative = original.iter().zip(&packed).map(|(a, b)| (b - a).abs() / a);
    Ok(relative.fold(0.0, f64::max))
}

/// To three digits: the last ones depend on the processor.
fn rounded(value: f64) -> f64 {
    format!("{value:.2e}").parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_digits_are_kept() {
        assert_eq!(rounded(0.001_234_5), 0.001_23);
        assert_eq!(rounded(0.0), 0.0);
    }
}
