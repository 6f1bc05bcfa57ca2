#version 430

uniform sampler2D places;   // w: the cosine towards the light
uniform sampler2D sides;
uniform vec3 light;         // in which it travels
uniform int side;           // of the picture, in pixels

struct Ray {
    vec4 start;             // w: the least distance
    vec4 along;             // w: the greatest distance
};

layout(std430, binding = 1) buffer Rays {
    Ray rays[];
};

in vec2 uv;

out vec4 color;

void main() {
    ivec2 at = ivec2(uv * float(side));
    vec4 place = texelFetch(places, at, 0);
    Ray ray;
    // A little off the surface, or the ray would meet it.
    ray.start = vec4(place.xyz + 0.001 * texelFetch(sides, at, 0).xyz, 0.0);
    // What turns away from the light is dark already: a ray that ends where it begins is not traced.
    ray.along = vec4(-light, place.w > 0.0 ? 10000.0 : 0.0);
    rays[at.y * side + at.x] = ray;
    color = ray.start;
}
