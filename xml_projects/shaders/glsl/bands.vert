#version 330

uniform mat4 pvm;
uniform vec4 eye;

in vec4 position;
in vec3 normal;
in vec2 texCoord0;

out Surface {
    vec3 normal;
    vec3 toEye;
    vec2 uv;
} surface;

void main() {
    surface.normal = normal;
    surface.toEye = eye.xyz - position.xyz;
    surface.uv = texCoord0;
    gl_Position = pvm * position;
}
