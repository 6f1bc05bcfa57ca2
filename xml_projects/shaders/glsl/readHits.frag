#version 430

uniform sampler2D paint;
uniform int side;           // of the picture, in pixels

struct Hit {
    float t;                // the distance, -1 without a hit
    int triangle;           // -1 without a hit
    float u, v;
};

layout(std430, binding = 2) buffer Hits {
    Hit hits[];
};

in vec2 uv;

out vec4 color;

void main() {
    ivec2 at = ivec2(uv * float(side));
    Hit hit = hits[at.y * side + at.x];
    color = texelFetch(paint, at, 0) * (hit.triangle < 0 ? 1.0 : 0.5);
}
