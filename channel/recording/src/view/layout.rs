//! Layout of the pictures: the viewer's blueprint.

use re_sdk::blueprint::{
    Blueprint, BlueprintPanel, ContainerLike, Horizontal, SelectionPanel, Spatial2DView, Tabs,
    TensorView, TextDocumentView, TextLogView, TimePanel, TimeSeriesView, Vertical,
};
use re_sdk_types::blueprint::components::{PanelState, PlayState};

use super::{Play, TimeOrigin};

/// Returns the layout with one tab per finger.
pub(super) fn blueprint(fingers: &[&str], origin: TimeOrigin, play: Play) -> Blueprint {
    let play = match play {
        Play::Following => PlayState::Following,
        Play::FromBeginning => PlayState::Playing,
    };
    let fingers: Vec<ContainerLike> = fingers.iter().map(|id| finger(id, origin)).collect();
    Blueprint::new(Tabs::new(fingers))
        .with_auto_layout(false)
        .with_auto_views(false)
        .with_blueprint_panel(BlueprintPanel::from_state(PanelState::Collapsed))
        .with_selection_panel(SelectionPanel::from_state(PanelState::Hidden))
        .with_time_panel(
            TimePanel::new()
                .with_state(PanelState::Collapsed)
                .with_timeline("time")
                .with_play_state(play),
        )
}

fn finger(id: &str, origin: TimeOrigin) -> ContainerLike {
    let traces = TimeSeriesView::new("taxels, digits").with_origin(format!("{id}/traces"));
    let heatmap = TensorView::new("skin").with_origin(format!("{id}/heatmap"));
    let words = TextDocumentView::new("belief").with_origin(format!("{id}/belief/text"));
    let events = TextLogView::new("events").with_origin("events");
    match origin {
        // There are no beliefs about the sweeps of a data set.
        TimeOrigin::Begin => Vertical::new([
            Horizontal::new([heatmap.into(), events.into()]).into(),
            traces.into(),
        ])
        .with_row_shares(vec![1.0, 1.4])
        .with_name(id)
        .into(),
        TimeOrigin::Epoch => {
            let bars =
                Spatial2DView::new("likeliest materials").with_origin(format!("{id}/belief/bars"));
            let posterior =
                TimeSeriesView::new("posterior").with_origin(format!("{id}/belief/posterior"));
            let latency = TimeSeriesView::new("latency, ms").with_origin(format!("{id}/latency"));
            Vertical::new([
                Horizontal::new([heatmap.into(), bars.into(), words.into()]).into(),
                traces.into(),
                Horizontal::new([posterior.into(), latency.into(), events.into()]).into(),
            ])
            .with_row_shares(vec![1.2, 1.0, 1.0])
            .with_name(id)
            .into()
        }
    }
}
