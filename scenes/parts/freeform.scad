// Free-form block, 60 x 60 mm, its top a smooth surface with radii of curvature above 15 mm.
// The lines of the grid are spaced unevenly, so that no step-over is commensurable with them.

n = 120;      // intervals a side
side = 60;    // mm

function spaced(i) = side * (i / n - 0.5 + 0.02 * sin(540 * i / n));
function deg(rad) = rad * 180 / PI;
function top(x, y) =
  10 + 2.4 * sin(deg(x / 9 + 0.3)) * cos(deg(y / 11)) + 0.8 * cos(deg(x / 17 - y / 8));

function rim(k) =  // grid indices of rim point k, counter-clockwise seen from above
  k < n ? [k, 0] : k < 2 * n ? [n, k - n] : k < 3 * n ? [3 * n - k, n] : [0, 4 * n - k];

upper = [for (j = [0:n], i = [0:n]) [spaced(i), spaced(j), top(spaced(i), spaced(j))]];
lower = [for (k = [0:4 * n - 1]) [spaced(rim(k)[0]), spaced(rim(k)[1]), 0]];
first_lower = (n + 1) * (n + 1);
middle = first_lower + 4 * n;

function at(i, j) = j * (n + 1) + i;
function upper_rim(k) = at(rim(k % (4 * n))[0], rim(k % (4 * n))[1]);
function lower_rim(k) = first_lower + k % (4 * n);

// faces are clockwise seen from outside, as OpenSCAD wants them; the diagonals alternate
faces = concat(
  [for (j = [0:n - 1], i = [0:n - 1]) (i + j) % 2 == 0
    ? [at(i, j), at(i + 1, j + 1), at(i + 1, j)] : [at(i, j), at(i, j + 1), at(i + 1, j)]],
  [for (j = [0:n - 1], i = [0:n - 1]) (i + j) % 2 == 0
    ? [at(i, j), at(i, j + 1), at(i + 1, j + 1)] : [at(i + 1, j), at(i, j + 1), at(i + 1, j + 1)]],
  [for (k = [0:4 * n - 1]) [upper_rim(k), upper_rim(k + 1), lower_rim(k + 1)]],
  [for (k = [0:4 * n - 1]) [upper_rim(k), lower_rim(k + 1), lower_rim(k)]],
  [for (k = [0:4 * n - 1]) [lower_rim(k), lower_rim(k + 1), middle]]);

polyhedron(points = concat(upper, lower, [[0, 0, 0]]), faces = faces);
