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

// One rotation of Jacobi's that takes away the element (i, j) of `a` and is carried along in `v`.
void jacobi_turn(inout mat4 a, inout mat4 v, int i, int j)
{
  float off = a[i][j];
  if (abs(off) < 1e-30) {
    return;
  }
  float theta = (a[j][j] - a[i][i]) / (2.0 * off);
  float t = ((theta < 0.0) ? -1.0 : 1.0) / (abs(theta) + sqrt(1.0 + theta * theta));
  float c = inversesqrt(1.0 + t * t);
  float s = t * c;
  for (int k = 0; k < 4; k++) {
    float x = a[k][i];
    float y = a[k][j];
    a[k][i] = c * x - s * y;
    a[k][j] = s * x + c * y;
  }
  for (int k = 0; k < 4; k++) {
    float x = a[i][k];
    float y = a[j][k];
    a[i][k] = c * x - s * y;
    a[j][k] = s * x + c * y;
    x = v[i][k];
    y = v[j][k];
    v[i][k] = c * x - s * y;
    v[j][k] = s * x + c * y;
  }
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
    jacobi_turn(a, v, 0, 1);
    jacobi_turn(a, v, 0, 2);
    jacobi_turn(a, v, 0, 3);
    jacobi_turn(a, v, 1, 2);
    jacobi_turn(a, v, 1, 3);
    jacobi_turn(a, v, 2, 3);
  }
  vec4 best = v[0];
  float largest = a[0][0];
  for (int k = 1; k < 4; k++) {
    if (a[k][k] > largest) {
      largest = a[k][k];
      best = v[k];
    }
  }
  return normalize(vec4(best.yzw, best.x));  // K's order is w, x, y, z
}
