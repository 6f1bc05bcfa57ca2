#version 430

#define SIDE 8

layout(local_size_x = SIDE, local_size_y = SIDE) in;

uniform sampler2D paint;
uniform sampler2D sides;                // normals; 0 where nothing is
uniform writeonly image2D drawing;

// The normals of a work group's pixels, and of those around them.
shared vec3 normals[(SIDE + 2) * (SIDE + 2)];

int place(ivec2 at) {
    return (at.y + 1) * (SIDE + 2) + at.x + 1;
}

void keep(ivec2 corner, ivec2 at) {
    ivec2 inside = clamp(corner + at, ivec2(0), imageSize(drawing) - 1);
    normals[place(at)] = texelFetch(sides, inside, 0).xyz;
}

void main() {
    ivec2 at = ivec2(gl_LocalInvocationID.xy);
    ivec2 corner = SIDE * ivec2(gl_WorkGroupID.xy);
    keep(corner, at);
    if (at.x == 0) {
        keep(corner, ivec2(-1, at.y));
        keep(corner, ivec2(SIDE, at.y));
    }
    if (at.y == 0) {
        keep(corner, ivec2(at.x, -1));
        keep(corner, ivec2(at.x, SIDE));
    }
    barrier();
    vec3 around = normals[place(at + ivec2(1, 0))] + normals[place(at - ivec2(1, 0))]
        + normals[place(at + ivec2(0, 1))] + normals[place(at - ivec2(0, 1))];
    float ink = min(0.5 * length(4.0 * normals[place(at)] - around), 1.0);
    imageStore(drawing, corner + at, vec4(texelFetch(paint, corner + at, 0).rgb * (1.0 - ink), 1.0));
}
