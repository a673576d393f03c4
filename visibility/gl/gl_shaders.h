#pragma once
// The GLSL of the occlusion map and of the orthographic cull map. Why they err to visible:
// gl_occlusion_map.h, gl_shadow_map.h.

namespace ivis {

/// Of all: axes of u and v on the faces that look along each axis, as visibility/depth_cube.h.
inline constexpr const char* kCommonShader = R"(#version 450 core
const int kAxisU[3] = int[3](2, 0, 0);
const int kAxisV[3] = int[3](1, 2, 1);
)";

/// Two triangles a face, all set up again at each of their six corners: nothing is interpolated.
inline constexpr const char* kDrawVertexShader = R"(
struct Face { vec4 corner[4]; };  // of the first three w: the normal
layout(std430, binding = 0) readonly buffer Faces { Face faces[]; };
layout(std430, binding = 1) readonly buffer Refs { uint refs[]; };  // 2 * face + sheet
layout(location = 0) uniform vec3 eye;
layout(location = 1) uniform uint side;
layout(location = 2) uniform float pixels;
layout(location = 3) uniform float near_m;
layout(location = 4) uniform float snap;  // pixels
layout(location = 5) uniform float depth_guard;
layout(location = 6) uniform float edge_on;
layout(location = 7) uniform float clip_ratio;
flat out vec3 depth;  // near / w = depth.x + depth.y i + depth.z j
flat out vec3 edges[4];
const int kCorner[6] = int[6](0, 1, 2, 0, 2, 3);

void main() {
  uint index = uint(gl_VertexID);
  uint ref = refs[index / 6u];
  Face face = faces[ref >> 1u];
  vec3 p[4];
  float size = 0.0;
  for (int c = 0; c < 4; ++c) {
    p[c] = face.corner[c].xyz - eye;
    vec3 a = abs(p[c]);
    size = max(size, max(a.x, max(a.y, a.z)));
    edges[c] = vec3(0.0);
  }
  depth = vec3(0.0);
  vec3 n = vec3(face.corner[0].w, face.corner[1].w, face.corner[2].w);
  float away = n.x * p[0].x + n.y * p[0].y + n.z * p[0].z;
  if (!(away < -edge_on * size)) {
    gl_Position = vec4(2.0, 2.0, 0.0, 1.0);  // all three corners: nothing
    return;
  }
  int w = int(side >> 1u);
  int u = kAxisU[w];
  int v = kAxisV[w];
  float sign_w = (side & 1u) != 0u ? -1.0 : 1.0;
  float scale = (1.0 + depth_guard * (size / away)) * near_m / away;
  float step = 2.0 / pixels;
  float v0 = 1.0 / pixels - 1.0;
  float gu = n[u] * scale;
  float gv = n[v] * scale;
  float along_i = gu * step;
  float along_j = gv * step;
  // Farther by what the pixel's centre may have moved; of a sheet, by half a pixel.
  float moved = (ref & 1u) != 0u ? 0.5 : snap;
  depth = vec3(sign_w * (n[w] * scale) + (gu + gv) * v0 -
               moved * (abs(along_i) + abs(along_j)), along_i, along_j);
  float least = size;
  for (int c = 0; c < 4; ++c) least = min(least, sign_w * p[c][w]);
  if (least < clip_ratio * size)
    for (int c = 0; c < 4; ++c) {
      vec3 from = p[c];
      vec3 along = p[(c + 1) & 3] - from;
      vec3 e = vec3(along.y * from.z - along.z * from.y, along.z * from.x - along.x * from.z,
                    along.x * from.y - along.y * from.x);
      edges[c] = vec3(sign_w * e[w] + (e[u] + e[v]) * v0, e[u] * step, e[v] * step);
    }
  vec3 at = p[kCorner[index % 6u]];
  gl_Position = vec4(at[u], at[v], 0.0, sign_w * at[w]);
}
)";

inline constexpr const char* kDrawFragmentShader = R"(
flat in vec3 depth;
flat in vec3 edges[4];

void main() {
  vec2 ij = floor(gl_FragCoord.xy);
  for (int c = 0; c < 4; ++c)
    if (edges[c].x + edges[c].y * ij.x + edges[c].z * ij.y < 0.0) discard;
  gl_FragDepth = clamp(depth.x + depth.y * ij.x + depth.z * ij.y, 0.0, 1.0);
}
)";

/// One level of the pyramid: each value is the least of up to 4 x 4 of the level below. Level 0 is
/// the map itself.
inline constexpr const char* kPyramidShader = R"(
layout(local_size_x = 8, local_size_y = 8) in;
layout(binding = 0) uniform sampler2DArray map;
layout(std430, binding = 2) buffer Pyramid { float pyramid[]; };
layout(location = 0) uniform int below;        // where the level below begins; < 0: the map
layout(location = 1) uniform int below_width;
layout(location = 2) uniform int here;
layout(location = 3) uniform int here_width;

void main() {
  ivec3 at = ivec3(gl_GlobalInvocationID);
  if (at.x >= here_width || at.y >= here_width) return;
  ivec2 first = 4 * at.xy;
  ivec2 last = min(first + 3, ivec2(below_width - 1));
  float least = 1.0;
  for (int j = first.y; j <= last.y; ++j)
    for (int i = first.x; i <= last.x; ++i)
      least = min(least, below < 0 ? texelFetch(map, ivec3(i, j, at.z), 0).x
                                   : pyramid[below + (at.z * below_width + j) * below_width + i]);
  pyramid[here + (at.z * here_width + at.y) * here_width + at.x] = least;
}
)";

/// One invocation a box. As project() and rectangle_hidden() of visibility/depth_cube.cpp.
inline constexpr const char* kTestShader = R"(
layout(local_size_x = 64) in;
struct Box { vec4 lo; vec4 hi; };
layout(binding = 0) uniform sampler2DArray map;
layout(std430, binding = 2) readonly buffer Pyramid { float pyramid[]; };
layout(std430, binding = 3) readonly buffer Boxes { Box boxes[]; };
layout(std430, binding = 4) writeonly buffer Visible { uint visible[]; };
layout(location = 0) uniform vec3 eye;
layout(location = 1) uniform uint count;
layout(location = 2) uniform float pixels;
layout(location = 3) uniform float near_m;
layout(location = 4) uniform float pixel_guard;
layout(location = 5) uniform float relative;
layout(location = 6) uniform int top;        // the last level
layout(location = 7) uniform int begins[9];  // of the levels; of 0, the map itself, nothing
const int kMostCells = 1024;
shared uint words[2];

float least_of(int level, int side, int i, int j) {
  if (level == 0) return texelFetch(map, ivec3(i, j, side), 0).x;
  int width = (int(pixels) + (1 << (2 * level)) - 1) >> (2 * level);
  return pyramid[begins[level] + (side * width + j) * width + i];
}

// Whether all pixels lo..hi are at least q. Cells that stick out of the rectangle are looked at
// again one level finer, as long as that is not too much work: then no.
bool all_reach(int side, ivec2 lo, ivec2 hi, float q) {
  ivec2 middle = (lo + hi) / 2;
  if (least_of(0, side, middle.x, middle.y) < q) return false;
  int span = max(hi.x - lo.x, hi.y - lo.y);
  int level = 0;
  while (level < top && (span >> (2 * level)) >= 4) ++level;
  for (; level >= 0; --level) {
    ivec2 first = lo >> (2 * level);
    ivec2 last = hi >> (2 * level);
    if ((last.x - first.x + 1) * (last.y - first.y + 1) > kMostCells) return false;
    bool sure = true;
    for (int j = first.y; j <= last.y; ++j)
      for (int i = first.x; i <= last.x; ++i) {
        if (least_of(level, side, i, j) >= q) continue;
        ivec2 from = ivec2(i, j) << (2 * level);
        ivec2 to = min(from + (1 << (2 * level)) - 1, ivec2(int(pixels) - 1));
        if (from.x >= lo.x && from.y >= lo.y && to.x <= hi.x && to.y <= hi.y) return false;
        sure = false;
      }
    if (sure) return true;
  }
  return false;
}

int pixel(float side_m, float w, float guard) {
  return int(clamp((side_m / w + 1.0) * (0.5 * pixels) + guard, 0.0, pixels - 1.0));
}

bool shows(vec3 lo, vec3 hi) {
  vec3 gap = max(lo, -hi);
  for (int side = 0; side < 6; ++side) {
    int w = side >> 1;
    int u = kAxisU[w];
    int v = kAxisV[w];
    float w_lo = (side & 1) != 0 ? -hi[w] : lo[w];
    float w_hi = (side & 1) != 0 ? -lo[w] : hi[w];
    if (!(max(max(gap[u], gap[v]), 0.0) <= w_hi)) continue;
    float w0 = max(w_lo, max(gap[u], gap[v]));
    if (!(w0 >= near_m)) return true;
    float w1 = max(w0, w_hi);
    ivec2 first = ivec2(pixel(lo[u], lo[u] < 0.0 ? w0 : w1, -pixel_guard),
                        pixel(lo[v], lo[v] < 0.0 ? w0 : w1, -pixel_guard));
    ivec2 last = ivec2(pixel(hi[u], hi[u] > 0.0 ? w0 : w1, pixel_guard),
                       pixel(hi[v], hi[v] > 0.0 ? w0 : w1, pixel_guard));
    if (!all_reach(side, first, last, (near_m / w0) * (1.0 + relative))) return true;
  }
  return false;
}

void main() {
  if (gl_LocalInvocationIndex < 2u) words[gl_LocalInvocationIndex] = 0u;
  barrier();
  uint group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
  uint index = group * 64u + gl_LocalInvocationIndex;
  if (index < count && shows(boxes[index].lo.xyz - eye, boxes[index].hi.xyz - eye))
    atomicOr(words[gl_LocalInvocationIndex >> 5u], 1u << (gl_LocalInvocationIndex & 31u));
  barrier();
  if (gl_LocalInvocationIndex < 2u && group * 64u < count)
    visible[2u * group + gl_LocalInvocationIndex] = words[gl_LocalInvocationIndex];
}
)";

/// Corners of polygons on the grid, each of one wall.
inline constexpr const char* kShadowVertexShader = R"(
layout(location = 0) in vec2 at;
layout(location = 1) in uint wall;
flat out uint wall_index;

void main() {
  wall_index = wall;
  gl_Position = vec4(at, 0.0, 1.0);
}
)";

/// A wall of a solid's shadow is ShadowWall of gl_shadow_map.cpp. In double precision, as the CPU.
inline constexpr const char* kShadowFragmentShader = R"(
struct Wall { dvec2 a; dvec2 b; dvec2 plane; double top; uint first; uint count; };
layout(std430, binding = 0) readonly buffer Walls { Wall walls[]; };
layout(location = 0) uniform dvec2 lo;
layout(location = 1) uniform double square_m;
flat in uint wall_index;
layout(location = 0) out float height;

double cross2(dvec2 a, dvec2 b) { return a.x * b.y - a.y * b.x; }

// As OrthographicMap::draw_chain(), which says why.
void main() {
  uint first = walls[wall_index].first;
  uint last = first + walls[wall_index].count - 1u;
  ivec2 square = ivec2(gl_FragCoord.xy);
  dvec2 p[4];
  uint j0 = last;
  uint j1 = first;
  for (int k = 0; k < 4; ++k) {
    p[k] = lo + dvec2(square + ivec2(k & 1, k >> 1)) * square_m;
    if (!(cross2(walls[first].a, p[k]) > 0.0lf && cross2(walls[last].b, p[k]) < 0.0lf)) discard;
    uint j = wall_index;
    while (j > first && cross2(walls[j].a, p[k]) < 0.0lf) --j;
    while (j < last && cross2(walls[j].b, p[k]) > 0.0lf) ++j;
    j0 = min(j0, j);
    j1 = max(j1, j);
  }
  double top = walls[wall_index].top;
  double least = 1e30lf;
  for (uint j = j0; j <= j1; ++j)
    for (int k = 0; k < 4; ++k) {
      double behind = dot(walls[j].plane, p[k]);
      if (!(behind > 1.0lf)) discard;
      least = min(least, top * behind);
    }
  height = float(least - 1e-6lf * abs(least));
}
)";

}  // namespace ivis
