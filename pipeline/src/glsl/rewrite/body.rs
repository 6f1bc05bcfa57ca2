//! Copies functions, constants and structures token by token, and replaces outdated names by current ones.

use super::super::tokens::{Kind, Token};
use super::super::{Fault, SamplerKind, Stage};
use super::{
    Function, Origin, Reader, Variable, beside_name, compare_name, compare_projected_name, sampler_name, texture_name,
};

/// Functions whose first argument is a sampler, with their current names.
const SAMPLING: [(&str, &str); 21] = [
    ("texture", "texture"),
    ("textureLod", "textureLod"),
    ("textureGrad", "textureGrad"),
    ("textureOffset", "textureOffset"),
    ("textureLodOffset", "textureLodOffset"),
    ("textureProj", "textureProj"),
    ("textureProjLod", "textureProjLod"),
    ("texelFetch", "texelFetch"),
    ("texelFetchOffset", "texelFetchOffset"),
    ("textureSize", "textureSize"),
    ("textureGather", "textureGather"),
    ("textureQueryLevels", "textureQueryLevels"),
    ("texture2D", "texture"),
    ("texture2DLod", "textureLod"),
    ("texture2DProj", "textureProj"),
    ("texture2DProjLod", "textureProjLod"),
    ("textureQueryLod", "textureQueryLod"),
    ("textureCube", "textureCube"),
    ("textureCubeLod", "textureCubeLod"),
    ("shadow2D", "shadow2D"),
    ("shadow2DProj", "shadow2DProj"),
];

/// Built-in variables that are not supported, with the reason.
const WITHOUT: [(&str, &str); 10] = [
    ("gl_VertexID", "vertices are numbered otherwise than in the engine"),
    ("gl_PrimitiveID", "triangles are numbered otherwise than in the engine"),
    ("gl_PointSize", "triangles alone are drawn"),
    ("gl_PointCoord", "triangles alone are drawn"),
    ("gl_ClipDistance", "nothing is clipped but at the viewport"),
    ("gl_Layer", "targets have one layer"),
    ("gl_ViewportIndex", "a pass has one viewport"),
    ("gl_FragData", "declare the results: layout(location = 0) out vec4 color"),
    ("gl_SampleID", "a pixel has one sample a pass"),
    ("gl_ModelViewProjectionMatrix", "map a uniform to RENDERER PROJECTION_VIEW_MODEL"),
];

impl Reader<'_> {
    /// Copies a structure, a constant or a variable of the file to the rewritten source, and a function to the list of functions.
    /// Declarations of functions are left out, since functions are later placed after those that they call.
    pub(super) fn copy_statement(&mut self) -> Result<(), Fault> {
        let structure = self.peek(0).is_some_and(|token| token.is_word("struct"));
        let (begin, text, origins) = (self.at, self.done.text.len(), self.done.origins.len());
        let (mut depth, mut assigned, mut called) = (0_usize, false, None);
        while self.at < self.tokens.len() {
            let from = self.at;
            self.copy_token()?;
            for (index, token) in self.tokens[from..self.at.min(self.tokens.len())].iter().enumerate() {
                match token.text.as_str() {
                    "(" if depth == 0 && !assigned && called.is_none() => (called, depth) = (Some(from + index), 1),
                    "{" | "(" | "[" if token.kind == Kind::Sign => depth += 1,
                    "}" | ")" | "]" if token.kind == Kind::Sign => depth = depth.saturating_sub(1),
                    "=" if depth == 0 => assigned = true,
                    _ => {}
                }
            }
            let token = &self.tokens[self.at.min(self.tokens.len()) - 1];
            let body = token.is("}");
            let ends = depth == 0 && (token.is(";") || body && !structure && !assigned);
            if !ends {
                continue;
            }
            let Some(bracket) = called.filter(|_| !structure && !assigned) else { return Ok(()) };
            let text = self.done.text.split_off(text);
            let shift = self.done.text.len();
            let origins = self.done.origins.split_off(origins);
            if body {
                let called = self.tokens[bracket..self.at].windows(2);
                let calls = called.filter(|two| two[0].kind == Kind::Word && two[1].is("("));
                self.functions.push(Function {
                    name: self.tokens[bracket.saturating_sub(1).max(begin)].text.clone(),
                    text,
                    origins: origins.into_iter().map(|origin| Origin { at: origin.at - shift, ..origin }).collect(),
                    calls: calls.map(|two| two[0].text.clone()).collect(),
                });
            }
            return Ok(());
        }
        Ok(())
    }

    pub(super) fn copy_token(&mut self) -> Result<(), Fault> {
        let token = &self.tokens[self.at];
        self.at += 1;
        if token.kind != Kind::Word {
            self.put(&token.text, token);
            return Ok(());
        }
        let word = token.text.as_str();
        let after_dot = self.at >= 2 && self.tokens[self.at - 2].is(".");
        let called = self.peek(0).is_some_and(|next| next.is("("));
        if after_dot {
            self.put(word, token);
            return Ok(());
        }
        self.not_reserved(token)?;
        if word == "main" && called {
            self.put("curitiba_main", token);
            return Ok(());
        }
        if let Some((_, now)) = SAMPLING.iter().find(|(name, _)| *name == word && called) {
            return self.sampled(now, token);
        }
        if called && (self.counted(token)? || self.of_image(token)?) {
            return Ok(());
        }
        if let Some(members) = self.instances.get(word)
            && self.peek(0).is_some_and(|next| next.is("."))
        {
            let member = self.peek(1).ok_or_else(|| self.fault(token, "a block without its member", ""))?;
            let Some(global) = members.get(&member.text).cloned() else {
                let mut names: Vec<&str> = members.keys().map(String::as_str).collect();
                names.sort_unstable();
                let message = format!("`{word}` has no member `{}`", member.text);
                return Err(self.fault(member, message, &format!("valid: {}", names.join(", "))));
            };
            self.at += 2;
            self.put(&global, token);
            return Ok(());
        }
        if let Some((name, why)) = WITHOUT.iter().find(|(name, _)| *name == word) {
            return Err(self.fault(token, format!("`{name}` is not there: {why}"), ""));
        }
        let replaced = match word {
            "gl_FragCoord" => {
                self.done.coordinates = true;
                "curitiba_FragCoord"
            }
            "gl_FragColor" => {
                if !self.done.outputs.iter().any(|output| output.key == "gl_FragColor") {
                    let global = "curitiba_FragColor".to_owned();
                    let (key, kind, location) = ("gl_FragColor".to_owned(), "vec4".to_owned(), Some(0));
                    let token = token.clone();
                    let output = Variable { key, global, kind, parts: None, flat: false, location, used: true, token };
                    self.done.outputs.push(output);
                }
                "curitiba_FragColor"
            }
            "gl_FragDepth" if self.stage == Stage::Fragment => {
                self.done.depth = true;
                "curitiba_FragDepth"
            }
            "gl_InstanceID" if self.stage == Stage::Vertex => "int ( gl_InstanceIndex )",
            "dFdy" | "dFdyFine" | "dFdyCoarse" if called => "curitiba_dFdy",
            other => other,
        };
        self.put(replaced, token);
        Ok(())
    }

    /// Rewrites a sampling call up to its sampler; `now` is the function's current name.
    fn sampled(&mut self, now: &str, token: &Token) -> Result<(), Fault> {
        let open = self.next()?;
        let Some(first) = self.peek(0) else { return Ok(()) };
        let named =
            self.element().filter(|(_, length)| self.peek(*length).is_some_and(|next| next.is(",") || next.is(")")));
        let known = named.and_then(|(name, length)| Some((self.sampler_names.get(&name).copied()?, name, length)));
        let Some((kind, name, length)) = known else {
            let help = "valid: a `uniform sampler2D`, `sampler2DShadow` or `samplerCube` of this file, by its name, in arrays with a number";
            return Err(self.fault(first, format!("`{}` is not a sampler that is declared above", first.text), help));
        };
        let (texture, sampler) = (texture_name(&name), sampler_name(&name));
        let whole = match kind {
            SamplerKind::Cube => format!("samplerCube ( {texture} , {sampler} )"),
            SamplerKind::Color | SamplerKind::Compared => format!("sampler2D ( {texture} , {sampler} )"),
        };
        match (kind, now) {
            (SamplerKind::Color | SamplerKind::Compared, "textureCube" | "textureCubeLod") => {
                let message = format!("`{now}` looks up a direction, and `{}` is no samplerCube", first.text);
                return Err(self.fault(first, message, "declare it as samplerCube"));
            }
            (
                SamplerKind::Cube,
                "texture" | "textureCube" | "textureLod" | "textureCubeLod" | "textureGrad" | "textureSize",
            ) => {
                self.at += length;
                self.put(&now.replace("Cube", ""), token);
                self.put("(", open);
                self.put(&whole, first);
            }
            (SamplerKind::Cube, _) => {
                let message = format!("`{}` of a samplerCube is not supported", token.text);
                return Err(self.fault(token, message, "valid: texture, textureLod, textureGrad, textureSize"));
            }
            (SamplerKind::Color, "shadow2D" | "shadow2DProj") => {
                let message = format!("`{now}` compares depths, and `{}` is a sampler2D", first.text);
                return Err(self.fault(first, message, "declare it as sampler2DShadow"));
            }
            // The compiler ignores the offset, so a generated function adds it.
            (SamplerKind::Color, "texelFetchOffset") => {
                self.at += length + 1;
                self.put(&beside_name(&name), token);
                self.put("(", open);
            }
            (SamplerKind::Color, _) | (SamplerKind::Compared, "textureSize") => {
                self.at += length;
                self.put(now, token);
                self.put("(", open);
                self.put(&whole, first);
            }
            (SamplerKind::Compared, "texture" | "textureLod" | "textureProj" | "shadow2D" | "shadow2DProj") => {
                // The coordinates follow the sampler and its comma.
                self.at += length + 1;
                let projected = now.ends_with("Proj");
                let name = if projected { compare_projected_name(&name) } else { compare_name(&name) };
                let vector = if now.starts_with("shadow2D") { "_4" } else { "" };
                self.put(&format!("{name}{vector}"), token);
                self.put("(", open);
            }
            (SamplerKind::Compared, _) => {
                let message = format!("`{now}` of a sampler2DShadow is not supported");
                return Err(self.fault(token, message, "valid: texture, textureProj, textureLod, textureSize"));
            }
        }
        Ok(())
    }
}
