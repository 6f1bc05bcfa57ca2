//! The section of an effect: pictures with a divider, FLIP maps, speed against error, times of the steps, and all settings.

use super::{Plots, table};
use crate::bench::model::{BenchRow, RowError};
use crate::report::model::{Effect, Picture, ReportData, Section, rmse};
use crate::report::number::{error, significant};
use crate::report::plots;
use maud::{Markup, html};

/// The section of an effect.
pub fn section(data: &ReportData, section: &Section, plots: &mut Plots) -> Markup {
    let id = section.effect.id();
    let rows: Vec<&BenchRow> = data.settings(section).map(|(_, row)| row).collect();
    let without: Vec<&BenchRow> = rows.iter().copied().filter(|row| rmse(row).is_none()).collect();
    html! {
        section aria-labelledby=(id) {
            h2 id=(id) { (section.effect.title()) }
            p { (about(section.effect)) " View " (section.view) "." }
            h3 { "Pictures" }
            (pictures(data, section))
            (flip_maps(section))
            h3 { "Speed against error" }
            (plots.figure(
                &format!("{id}-speed"),
                plots::speed_against_error(data, section),
                &html! {
                    "Every mark is one setting, with the 95 % interval of its median time; the line joins those that no other beats in both speed and error (the Pareto "
                    "front), and they are named where there is room."
                },
                "No setting of this effect has both a time and an error.",
            ))
            @if let Some(first) = without.first() {
                p.note {
                    (without.len()) " of " (rows.len()) " settings have no error and no mark. "
                    @if let RowError::Missing(why) = &first.error { (first.label) ": " (why) "." }
                }
            }
            h3 { "Where the time goes" }
            (plots.figure(
                &format!("{id}-frames"),
                plots::frame_bars(&format!("{}: median time of each step of a frame", section.effect.title()), &rows, section.effect.title()),
                &html! {
                    "Median host time of each step, the fastest frame first. The figure at the end of a bar is the median of the whole frame, "
                    "the whisker its 95 % interval."
                },
                "No setting of this effect was measured.",
            ))
            (graphs(data, section, plots))
            h3 { "All settings" }
            @if rows.is_empty() {
                p.note { "None was measured." }
            } @else {
                (table::rows(data, &rows, &format!("{}, every setting", section.effect.title())))
            }
        }
    }
}

/// The graphs of the rows with pictures, by raster and by rays. Rows that differ only in settings share one graph.
fn graphs(data: &ReportData, section: &Section, plots: &mut Plots) -> Markup {
    let mut known: Vec<&[[String; 2]]> = Vec::new();
    let different: Vec<_> = section
        .graphs
        .iter()
        .filter(|graph| {
            let new = !known.contains(&graph.passes.as_slice());
            known.push(&graph.passes);
            new
        })
        .filter_map(|graph| Some((graph, data.row(&graph.row)?)))
        .collect();
    html! {
        @if !different.is_empty() {
            h3 { "What passes hand on" }
            @for (index, (graph, row)) in different.iter().enumerate() {
                (plots.figure(
                    &format!("{}-passes-{}", section.effect.id(), index + 1),
                    plots::pass_graph(graph, row),
                    &html! {
                        (graph.label) ". On each edge what the pass before it took, and the attachments that it hands on."
                    },
                    "It has no passes.",
                ))
            }
        }
    }
}

fn about(effect: Effect) -> &'static str {
    match effect {
        Effect::Shadows => {
            "By raster, depth maps drawn from the light, one for each range of distances; their texels blur and shift the edges. By rays, \
             one ray to the light from each pixel, exact for a light without extent."
        }
        Effect::SoftShadows => {
            "The light is a disc of 0.53 degrees, as the sun is. By raster, percentage-closer soft shadows: depth maps tell how far off what \
             hides the light is, and how wide to blur. By rays, some to points of the disc; with a filter, averaged over the surface."
        }
        Effect::Reflection => {
            "By raster, a cube map drawn from the middle of the pane: what is near the pane is seen from a wrong place, and no \
             pane sees another; or the camera mirrored at the plane of the panes, which sees in each pixel what its mirrored ray meets first; \
             or a march through the picture itself, which answers the rays that meet what it shows. By rays, the mirrored ray itself, and on to other panes."
        }
        Effect::Refraction => {
            "By raster, two look-ups in a cube map, weighted by the Fresnel equations; or a march through the picture without its glass, \
             which answers the rays that meet what it shows. By rays, the mirrored and the bent ray, \
             at every pane that they meet."
        }
        Effect::Occlusion => {
            "By raster, what the G-buffer shows around a pixel: nothing outside the window or behind the nearest surface can \
             occlude. By rays, the half sphere above each point."
        }
    }
}

fn alt(section: &Section, picture: &Picture) -> String {
    format!("{} seen from view {}. {}", section.effect.title(), section.view, picture.label)
}

fn pictures(data: &ReportData, section: &Section) -> Markup {
    let Some((reference, others)) = section.pictures.split_last() else {
        return html! { p.note { "No picture could be rendered." } };
    };
    let Some(first) = others.first() else { return single(section, reference) };
    let size = reference.size;
    let id = section.effect.id();
    let options = |chosen: &Picture| {
        html! {
            @for picture in &section.pictures {
                option value=(picture.file) data-alt=(alt(section, picture)) selected[picture == chosen] { (picture.label) }
            }
        }
    };
    html! {
        div.compare id={ "compare-" (id) } hidden {
            div.choice {
                label { span { "Left" } select.of-left { (options(first)) } }
                label { span { "Right" } select.of-right { (options(reference)) } }
            }
            div.tools {
                label { span { "Compare by" }
                    select.mode {
                        option value="divider" { "divider" }
                        option value="flicker" { "flicker" }
                        option value="difference" { "difference" }
                    }
                }
                label { span { "Zoom" }
                    select.zoom {
                        option value="fit" { "fit" }
                        @for (value, name) in [("1", "1 × (as measured)"), ("2", "2 ×"), ("4", "4 ×"), ("8", "8 ×")] {
                            option value=(value) { (name) }
                        }
                    }
                }
                label { span { "Exposure " b.stops { "0" } " EV" }
                    input.exposure type="range" min="-6" max="6" step="0.5" value="0";
                }
                button.swap type="button" hidden { "Swap" }
            }
            div.window tabindex="0" role="group" aria-label="Pictures; scroll where they are larger than the window" {
                div.stage style=(format!("--wide:{}px", size[0])) {
                    img src=(reference.file) width=(size[0]) height=(size[1]) alt=(alt(section, reference));
                    img.over src=(first.file) width=(size[0]) height=(size[1]) alt=(alt(section, first));
                    span.line {}
                    input.divider type="range" min="0" max="100" step="1" value="50" aria-label="Divider between the two pictures";
                }
            }
            p.names { b.left { (first.label) } b.right { (reference.label) } }
            p.note {
                "Drag the divider, or focus it and use the arrow keys. Flicker shows the two in turns, difference what is between them. At zoom 1 a pixel of the "
                "picture is a pixel of the window. Exposure multiplies the light that is displayed, and makes small differences seen; what the picture "
                "file cut off at white stays cut off."
            }
        }
        div.pictures {
            @for picture in &section.pictures {
                figure {
                    img src=(picture.file) width=(picture.size[0]) height=(picture.size[1]) alt=(alt(section, picture));
                    figcaption { (picture.label) (figures(data, picture)) }
                }
            }
        }
    }
}

fn single(section: &Section, picture: &Picture) -> Markup {
    html! {
        figure {
            img src=(picture.file) width=(picture.size[0]) height=(picture.size[1]) alt=(alt(section, picture));
            figcaption { (picture.label) }
        }
    }
}

/// `: 12.3 ms, RMSE 0.01`.
fn figures(data: &ReportData, picture: &Picture) -> Markup {
    let row = picture.row.as_ref().and_then(|key| data.row(key));
    html! {
        @if let Some(row) = row {
            ": " (significant(row.frame.median)) " ms a frame"
            @if let Some((found, _)) = rmse(row) { ", RMSE " (error(found)) }
            @if let Some((found, at_most)) = table::of_picture(row) {
                ", of the picture " @if at_most { "≤ " } (error(found.rmse))
            }
        }
    }
}

fn flip_maps(section: &Section) -> Markup {
    html! {
        @if !section.flip_maps.is_empty() {
            h3 { "Where a person sees a difference" }
            p.note {
                "FLIP against the reference: 0 " span.bar role="img" aria-label="from black over purple and orange to pale yellow" {}
                " 1. Black is no visible difference."
            }
            div.pictures {
                @for map in &section.flip_maps {
                    figure {
                        img src=(map.file) width=(map.size[0]) height=(map.size[1])
                            alt=(format!("FLIP map of {}: brighter where the difference is easier to see", map.label));
                        figcaption { (map.label) ": mean FLIP " (error(map.mean)) }
                    }
                }
            }
        }
    }
}
