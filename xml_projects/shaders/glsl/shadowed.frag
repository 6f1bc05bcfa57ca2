#version 330

uniform sampler2DShadow depths;
uniform sampler2D wall;
uniform int textures;
uniform vec4 diffuse;
uniform vec4 eye;
uniform vec4 light;     // in which it travels
uniform float reach;    // up to where the map covers the view

// Four places beside each other, in texels of the map.
uniform vec2 around[4] = { vec2(-0.5, -0.5), vec2(0.5, -0.5), vec2(-0.5, 0.5), vec2(0.5, 0.5) };

in vec3 side;
in vec3 place;
in vec2 uv;
in vec4 inMap;

out vec4 color;

void main() {
    vec4 paint = textures > 1 ? diffuse * texture(wall, uv) : diffuse;
    float cosine = max(dot(normalize(side), -light.xyz), 0.0);
    float lit = 0.0;
    for (int i = 0; i < around.length(); i++) {
        vec4 beside = vec4(around[i] / vec2(textureSize(depths, 0)), 0.0, 0.0);
        lit += textureProj(depths, inMap + beside * inMap.w);
    }
    lit /= float(around.length());
    if (distance(place, eye.xyz) > reach) {
        lit = 1.0;
    }
    color = vec4(paint.rgb * (0.3 + 0.7 * cosine * lit), 1.0);
}
