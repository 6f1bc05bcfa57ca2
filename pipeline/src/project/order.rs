//! Checks that channels are written before they are read, in the order of the pipeline.

use super::ChannelRef;
use super::loader::Loader;
use super::report::{Span, shown};
use std::collections::HashMap;

/// Reads and writes of a pass.
pub(super) struct Facts {
    /// Name of the pass.
    pub name: String,
    /// Place of the pass in the file.
    pub span: Span,
    /// Channels that it reads, each with the place in the file that says so.
    pub reads: Vec<(ChannelRef, Span)>,
    /// Buffers and images that its shaders load, each with the place in the file that says so.
    pub loads: Vec<(ChannelRef, Span)>,
    /// Its render target, the target's number of colour channels, and the place in the file that names it.
    target: Option<(usize, usize, Span)>,
    /// Number of the target's colours that it writes, counted from the first.
    writes: usize,
    /// What happens to the target's depth, in the channel after the colours.
    depth: Kept,
    /// Storage buffers and images that its shaders store to.
    stores: Vec<ChannelRef>,
    /// Whether it may store to unknown buffers or images, since its shader could not be read.
    stores_unknown: bool,
    /// Whether the channels in [`Self::reads`] must have the size of its target.
    pub one_size: bool,
}

/// Effect of a pass on the depth of its target.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kept {
    /// The pass draws no triangles.
    Untouched,
    /// The pass writes the depth, so that later passes can read it.
    Written,
    /// The pass draws some triangles without own shaders, so the depth is not kept.
    Lost,
}

impl Facts {
    pub fn new(name: &str, span: Span) -> Self {
        let (name, depth) = (name.to_owned(), Kept::Untouched);
        Self {
            name,
            span,
            reads: Vec::new(),
            loads: Vec::new(),
            target: None,
            writes: 0,
            depth,
            stores: Vec::new(),
            stores_unknown: false,
            one_size: false,
        }
    }

    pub fn set_target(&mut self, target: Option<usize>, colors: usize, at: Span) {
        self.target = target.map(|target| (target, colors, at));
    }

    /// The target, and the place that names it, if it has no colour channels.
    pub fn colorless(&self) -> Option<(usize, Span)> {
        self.target.filter(|(_, colors, _)| *colors == 0).map(|(target, _, at)| (target, at))
    }

    /// The channel of the target's depth, if own shaders write it.
    pub fn depth_channel(&self) -> Option<ChannelRef> {
        let depth = self.target.filter(|_| self.depth == Kept::Written);
        depth.map(|(target, channel, _)| ChannelRef { target, channel })
    }

    /// Records that the pass draws triangles, and whether own shaders draw all of them.
    pub fn draws(&mut self, all_own: bool) {
        self.depth = if all_own { Kept::Written } else { Kept::Lost };
    }

    /// Records that the pass writes at most the first `count` channels of its target.
    pub fn writes_first(&mut self, count: usize) {
        self.writes = count;
    }

    /// Records that the pass stores to these buffers and images.
    pub fn stores(&mut self, buffers: impl Iterator<Item = ChannelRef>) {
        self.stores.extend(buffers);
    }

    /// Records that the pass may store to unknown buffers or images; an error was reported.
    pub fn stores_unknown(&mut self) {
        self.stores_unknown = true;
    }

    /// Records that the pass writes all channels of its target.
    pub fn writes_all(&mut self) {
        self.writes = usize::MAX;
    }

    /// The channels that earlier passes must write: those that it samples, and those that it loads and does not store to itself.
    fn needs(&self) -> impl Iterator<Item = &(ChannelRef, Span)> {
        let loaded = self.loads.iter().filter(|(channel, _)| !self.stores.contains(channel));
        self.reads.iter().chain(loaded)
    }

    fn written(&self) -> impl Iterator<Item = ChannelRef> {
        let (target, channels) = self.target.map_or((0, 0), |(target, channels, _)| (target, channels));
        let colors = (0..channels.min(self.writes)).map(move |channel| ChannelRef { target, channel });
        let depth = self.target.filter(|_| self.depth == Kept::Written);
        let depth = depth.map(|(target, channel, _)| ChannelRef { target, channel });
        colors.chain(depth).chain(self.stores.iter().copied())
    }
}

impl Loader {
    /// Reports reads of channels that no earlier pass writes, passes that read or store to their own target, passes that sample what
    /// they store to, and sizes that differ.
    pub fn check_order(&mut self, passes: &[Facts]) {
        // The first writer of each channel.
        let mut writers: HashMap<ChannelRef, usize> = HashMap::new();
        for (index, pass) in passes.iter().enumerate() {
            for channel in pass.written() {
                writers.entry(channel).or_insert(index);
            }
        }
        for pass in passes {
            let own = |channel: &&ChannelRef| pass.target.is_some_and(|(target, ..)| target == channel.target);
            if let Some(channel) = pass.stores.iter().find(own) {
                let name = shown(&self.libraries.channel_name(*channel));
                let message =
                    format!("pass `{}` stores to `{name}`, a channel of the target that it writes", shown(&pass.name));
                self.report.error_help(pass.span, message, || "write into another render target".to_owned());
            }
        }
        for pass in passes {
            let stored = |channel: &ChannelRef| pass.stores.iter().any(|own| own.target == channel.target);
            for (channel, at) in pass.reads.iter().filter(|(channel, _)| stored(channel)) {
                let name = shown(&self.libraries.channel_name(*channel));
                let message = format!("pass `{}` samples `{name}`, to which it stores", shown(&pass.name));
                self.report.error_help(*at, message, || "valid: imageLoad of the image".to_owned());
            }
        }
        for (index, pass) in passes.iter().enumerate() {
            for (channel, at) in pass.needs() {
                let name = self.libraries.channel_name(*channel);
                let reader = format!("pass `{}` reads `{}`", shown(&pass.name), shown(&name));
                if pass.target.is_some_and(|(target, ..)| target == channel.target) {
                    self.report.error_help(*at, format!("{reader}, a channel of the target that it writes"), || {
                        "write into another render target".to_owned()
                    });
                    continue;
                }
                let depth = self.libraries.targets[channel.target].channels[channel.channel].depth;
                let loses = |other: &&Facts| {
                    other.depth == Kept::Lost && other.target.is_some_and(|(t, ..)| t == channel.target)
                };
                if depth && let Some(lost) = passes[..index].iter().find(loses) {
                    let message =
                        format!("{reader}, a depth that pass `{}` draws without leaving it", shown(&lost.name));
                    self.report.error_help(*at, message, || {
                        "passes leave their depth that map an own shader to all materials (*)".to_owned()
                    });
                    continue;
                }
                match writers.get(channel) {
                    Some(writer) if *writer < index => {}
                    Some(_) if self.libraries.targets[channel.target].contents.is_some() => {}
                    Some(writer) => {
                        let (later, at_writer) = (&passes[*writer].name, passes[*writer].span);
                        let source = self.report.source(at_writer.file).clone();
                        self.report.error_help(*at, format!("{reader}, which no earlier pass writes"), || {
                            let (line, column) = source.line_column(at_writer.start as usize);
                            format!("the later pass `{}` of {line}:{column} writes it", shown(later))
                        });
                    }
                    None if passes[..index].iter().any(|pass| pass.stores_unknown) => {}
                    None if self.libraries.targets[channel.target].contents.is_some() => {}
                    None => {
                        // A depth without a name is no channel.
                        let targets = &self.libraries.targets;
                        let named = |channel: &ChannelRef| channel.channel < targets[channel.target].channels.len();
                        let written = passes[..index].iter().flat_map(Facts::written).filter(named);
                        let names = || written.map(|channel| self.libraries.channel_name(channel)).collect::<Vec<_>>();
                        self.report.error_help(*at, format!("{reader}, which no pass writes"), || {
                            let names = names();
                            super::report::suggest(&name, names.iter().map(String::as_str))
                        });
                    }
                }
            }
            if pass.one_size {
                self.check_sizes(pass);
            }
        }
    }

    fn check_sizes(&mut self, pass: &Facts) {
        let Some((target, _, at_target)) = pass.target else { return };
        let size_of = |loader: &Self, target: usize| loader.libraries.targets[target].size;
        let [width, height] = size_of(self, target);
        for (channel, at) in &pass.reads {
            let [input_width, input_height] = size_of(self, channel.target);
            if [input_width, input_height] == [width, height] {
                continue;
            }
            let name = self.libraries.channel_name(*channel);
            let message = format!(
                "pass `{}` reads `{}` of {input_width} x {input_height} and writes a target of {width} x {height}",
                shown(&pass.name),
                shown(&name)
            );
            let source = self.report.source(at_target.file).clone();
            self.report.error_help(*at, message, || {
                let (line, column) = source.line_column(at_target.start as usize);
                format!("both must have one size; the target is named at {line}:{column}")
            });
        }
    }
}
