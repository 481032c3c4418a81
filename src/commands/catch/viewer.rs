//! `--view` of the catching commands: output to the Rerun viewer.

use std::path::Path;

use clap::Args;

#[derive(Args)]
pub struct ViewerArgs {
    /// Show the content of the page in the Rerun viewer, write it to a file, or send it to a running viewer
    #[arg(long, value_name = "FILE.rrd|URL", num_args = 0..=1)]
    view: Option<Option<String>>,
}

impl ViewerArgs {
    /// Returns an error for an invalid target, before a long computation.
    pub fn check(&self) -> anyhow::Result<()> {
        #[cfg(not(feature = "rerun"))]
        if self.view.is_some() {
            anyhow::bail!(tactnet_models::MissingFeature { feature: "rerun" });
        }
        if let Some(Some(file)) = &self.view
            && Path::new(file).exists()
        {
            anyhow::bail!("{file}: expected a new file, found an existing one");
        }
        Ok(())
    }

    /// Returns the target of `--view`, if it is given.
    #[cfg(feature = "rerun")]
    pub fn target(&self) -> Option<tactnet_recording::view::Target> {
        use tactnet_recording::view::Target;
        let target = self.view.as_ref()?;
        Some(match target.as_deref() {
            None => Target::Viewer {
                memory_limit: "2GB".into(),
            },
            Some(url) if url.contains("://") => Target::Connect { url: url.into() },
            Some(path) => Target::File { path: path.into() },
        })
    }
}
