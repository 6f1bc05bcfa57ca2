#version 330

uniform sampler2D wall;
uniform int textures;
uniform vec4 diffuse;
uniform vec4 toLight;     // in which the light travels
uniform float bands;
uniform float line = 0.12;

in Surface {
    vec3 normal;
    vec3 toEye;
    vec2 uv;
} surface;

out vec4 color;

float banded(float light);

void main() {
    vec3 n = normalize(surface.normal);
    float facing = abs(dot(n, normalize(surface.toEye)));
    vec4 paint = textures > 0 ? diffuse * texture(wall, surface.uv) : diffuse;
    float light = 0.3 + 0.7 * banded(max(dot(n, -toLight.xyz), 0));
    color = vec4(paint.rgb * light * smoothstep(0, line, facing), 1);
}

float banded(float light) {
    return floor(light * bands + 0.5) / bands;
}
