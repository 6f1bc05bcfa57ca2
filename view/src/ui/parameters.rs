//! Parameters of a pass, from the table of parameters that the library has.

use crate::app::App;
use crate::worker::{Command, Parameter, PassFacts};
use curitiba::pipeline::plan::OWN_BACKEND;
use curitiba::pipeline::programs::Values;
use egui::{ComboBox, DragValue, Grid, Response, Role, Slider, Ui, WidgetInfo};

/// Draws the parameters; changes are sent to the renderer at once.
pub fn draw(app: &App, ui: &mut Ui, pass: &PassFacts) {
    Grid::new(("parameters", &pass.name)).num_columns(2).spacing([10.0, 3.0]).show(ui, |ui| {
        for parameter in &pass.parameters {
            let help = format!("{}\nvalid: {}", parameter.info.about, parameter.info.valid);
            ui.label(parameter.info.name).on_hover_text(&help);
            if let Some(value) = edit(app, ui, pass, parameter) {
                let (pass, name) = (pass.name.clone(), parameter.info.name.to_owned());
                app.worker.send(Command::Parameter { pass, name, value });
            }
            ui.end_row();
        }
    });
}

/// An editor for a parameter; returns its new value, or `None` if the user did not change it in this frame.
fn edit(app: &App, ui: &mut Ui, pass: &PassFacts, parameter: &Parameter) -> Option<String> {
    let label = format!("{} {}", pass.name, parameter.info.name);
    match parameter.info.values {
        Values::Names(names) => {
            let mut chosen = parameter.value.clone();
            let combo = ComboBox::from_id_salt(&label).width(110.0).selected_text(&chosen);
            let list = combo.show_ui(ui, |ui| {
                for name in names {
                    let missing = missing(app, parameter, name);
                    offer(ui, &mut chosen, (*name).to_owned(), name, missing.as_deref());
                }
            });
            named_list(&list.response, &label, &parameter.value);
            (chosen != parameter.value).then_some(chosen)
        }
        Values::Integer(low, high) => {
            let mut value: u32 = parameter.value.parse().ok()?;
            let slider = Slider::new(&mut value, low..=high).logarithmic(high > 64);
            let response = ui.add(slider);
            named(&response, &label, f64::from(value));
            response.changed().then(|| value.to_string())
        }
        Values::Number(low, high) => {
            let mut value: f32 = parameter.value.parse().ok()?;
            let slider = Slider::new(&mut value, low..=high).logarithmic(true).smallest_positive(0.01).max_decimals(3);
            let response = ui.add(slider);
            named(&response, &label, value.into());
            response.changed().then(|| value.to_string())
        }
        Values::Positive => {
            let mut value: f32 = parameter.value.parse().ok()?;
            let speed = f64::from(value.abs()).clamp(1e-6, 1e6) * 0.01;
            let response = ui.add(DragValue::new(&mut value).speed(speed).range(1e-6..=f32::MAX).max_decimals(6));
            named(&response, &label, value.into());
            response.changed().then(|| value.to_string())
        }
    }
}

/// An entry in a list of values. If `missing` gives a reason, the entry is disabled and shows the reason as its hover text.
pub(super) fn offer<T: PartialEq>(ui: &mut Ui, chosen: &mut T, value: T, name: &str, missing: Option<&str>) {
    let label = egui::Button::selectable(*chosen == value, name);
    let response = ui.add_enabled(missing.is_none(), label);
    if response.on_disabled_hover_text(missing.unwrap_or_default()).clicked() {
        *chosen = value;
    }
}

/// Why a ray backend for a single pass is not available; `None` if it is available, if that is not known yet, or for other parameters.
fn missing(app: &App, parameter: &Parameter, name: &str) -> Option<String> {
    if parameter.info.name != OWN_BACKEND.name {
        return None;
    }
    let available = app.available()?;
    available.rays.into_iter().find(|(backend, _)| backend.name() == name)?.1
}

/// Gives a list a name and its chosen value for screen readers.
pub(super) fn named_list(response: &Response, label: &str, chosen: &str) {
    response.widget_info(|| WidgetInfo {
        current_text_value: Some(chosen.to_owned()),
        ..WidgetInfo::labeled(Role::ComboBox, true, label)
    });
}

fn named(response: &Response, label: &str, value: f64) {
    response.widget_info(|| WidgetInfo { value: Some(value), ..WidgetInfo::labeled(Role::Slider, true, label) });
}
