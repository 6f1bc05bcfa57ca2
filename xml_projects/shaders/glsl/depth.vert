#version 330

uniform mat4 pvm;

in vec4 position;

void main() {
    gl_Position = pvm * position;
}
