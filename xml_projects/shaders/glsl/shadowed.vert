#version 330

uniform mat4 pvm;
uniform mat4 model;
uniform mat4 toMap;
uniform float bias;

in vec4 position;
in vec3 normal;
in vec2 texCoord0;

out vec3 side;
out vec3 place;
out vec2 uv;
out vec4 inMap;

void main() {
    side = normal;
    uv = texCoord0;
    place = vec3(model * position);
    // Off the surface by more than a texel of the map, or it would be in its own shadow.
    inMap = toMap * vec4(place + bias * normal, 1.0);
    gl_Position = pvm * position;
}
