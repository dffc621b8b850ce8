// Rotations as unit quaternions (xyz, w), and the one that fits a sum of direction pairs best.
// Davenport's form of Wahba's problem after Horn, "Closed-form solution of absolute orientation using unit quaternions",
// JOSA A 4(4), 1987: of the symmetric 4x4 matrix K the eigenvector of the largest eigenvalue, by cyclic Jacobi.

vec3 quaternion_turned(vec4 q, vec3 v)
{
  return v + 2.0 * cross(q.xyz, cross(q.xyz, v) + q.w * v);
}

vec4 quaternion_product(vec4 a, vec4 b)
{
  return vec4(a.w * b.xyz + b.w * a.xyz + cross(a.xyz, b.xyz), a.w * b.w - dot(a.xyz, b.xyz));
}

// The shortest way from one unit direction to another; of opposite ones about any axis at right angles.
vec4 quaternion_between(vec3 from, vec3 to)
{
  vec4 q = vec4(cross(from, to), 1.0 + dot(from, to));
  if (dot(q, q) < 1e-12) {
    vec3 tangent;
    vec3 bitangent;
    orthonormal_basis(from, tangent, bitangent);
    return vec4(tangent, 0.0);
  }
  return normalize(q);
}

// Cosine and sine of the rotation of Jacobi's that takes away the element `off` of a symmetric matrix, between the
// elements `first` and `second` of its diagonal.
vec2 jacobi_angle(float first, float second, float off)
{
  if (abs(off) < 1e-30) {
    return vec2(1.0, 0.0);
  }
  float theta = (second - first) / (2.0 * off);
  float t = ((theta < 0.0) ? -1.0 : 1.0) / (abs(theta) + sqrt(1.0 + theta * theta));
  float c = inversesqrt(1.0 + t * t);
  return vec2(c, t * c);
}

// Columns i and j of `m` turned by `angle`.
#define TURN_COLUMNS(m, i, j, angle) \
  { \
    vec4 one = m[i]; \
    vec4 other = m[j]; \
    m[i] = angle.x * one - angle.y * other; \
    m[j] = angle.y * one + angle.x * other; \
  }

// The rotation of `a` that takes away (i, j), from both sides, carried along in `v`. A macro, so that all indices are
// constants: a driver (NVIDIA, 580) made wrong turns of a function that was given them.
#define JACOBI_TURN(a, v, i, j) \
  { \
    vec2 angle = jacobi_angle(a[i][i], a[j][j], a[i][j]); \
    TURN_COLUMNS(a, i, j, angle) \
    a = transpose(a); \
    TURN_COLUMNS(a, i, j, angle) \
    TURN_COLUMNS(v, i, j, angle) \
  }

// The rotation nearest to a matrix B (columns), in the sense of the largest trace(R^T B): the rotational factor of its
// polar decomposition, of determinant 1.
vec4 rotation_nearest(mat3 b)
{
  // K of S = B^T, S_ij = sum w r_i e_j; b[j][i] is row i, column j of B = sum w e r^T.
  float xx = b[0][0];
  float yy = b[1][1];
  float zz = b[2][2];
  float xy = b[0][1];  // S_xy = B_yx
  float yx = b[1][0];
  float yz = b[1][2];
  float zy = b[2][1];
  float zx = b[2][0];
  float xz = b[0][2];
  mat4 a;
  a[0] = vec4(xx + yy + zz, yz - zy, zx - xz, xy - yx);
  a[1] = vec4(a[0].y, xx - yy - zz, xy + yx, zx + xz);
  a[2] = vec4(a[0].z, a[1].z, yy - xx - zz, yz + zy);
  a[3] = vec4(a[0].w, a[1].w, a[2].w, zz - xx - yy);
  mat4 v = mat4(1.0);
  for (int sweep = 0; sweep < 4; sweep++) {
    JACOBI_TURN(a, v, 0, 1)
    JACOBI_TURN(a, v, 0, 2)
    JACOBI_TURN(a, v, 0, 3)
    JACOBI_TURN(a, v, 1, 2)
    JACOBI_TURN(a, v, 1, 3)
    JACOBI_TURN(a, v, 2, 3)
  }
  vec4 values = vec4(a[0][0], a[1][1], a[2][2], a[3][3]);
  float largest = max(max(values.x, values.y), max(values.z, values.w));
  vec4 best = (values.x == largest) ? v[0] : (values.y == largest) ? v[1] : (values.z == largest) ? v[2] : v[3];
  return normalize(vec4(best.yzw, best.x));  // K's order is w, x, y, z
}
