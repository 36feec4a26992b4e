// Formulas of one gaussian, one pixel and one joint, forward and backward: binding, EWA projection, compositing, rotation
// vectors, Adam. The kernels and the host test (float64) compile this same text; avatar/binding.py, avatar/raster/ and
// avatar/skinning.py are the same on the CPU. The draw rule's constants stand before this text: avatar/draw_rule.py writes them.
#pragma once

#ifdef __CUDACC__
#define FORMULA static __device__ __forceinline__
#else
#include <cmath>
#define FORMULA static inline
using std::ceil; using std::cos; using std::exp; using std::floor; using std::fmax; using std::fmin; using std::log; using std::pow;
using std::sin; using std::sqrt;
#endif

template <class real> struct Vec { real x, y, z; };
template <class real> FORMULA Vec<real> operator+(Vec<real> a, Vec<real> b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
template <class real> FORMULA Vec<real> operator-(Vec<real> a, Vec<real> b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
template <class real> FORMULA Vec<real> operator*(Vec<real> a, real s) { return {a.x * s, a.y * s, a.z * s}; }
template <class real> FORMULA real dot(Vec<real> a, Vec<real> b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
template <class real> FORMULA Vec<real> cross(Vec<real> a, Vec<real> b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

// Axes a, n, b, middle T and size k of a face; p = v2 - v1, q = v0 - v1, d = v0 - v2. No area: R = I, k = 0.
template <class real> struct Face {
    Vec<real> a, n, b, T, p, q, d;
    real width, area2, side, height, k;
    bool valid;
};

template <class real> FORMULA Face<real> face_frame(Vec<real> v0, Vec<real> v1, Vec<real> v2) {
    Face<real> f;
    f.p = v2 - v1;
    f.q = v0 - v1;
    f.d = f.q - f.p;
    Vec<real> c = cross(f.p, f.q);
    real pp = dot(f.p, f.p), qq = dot(f.q, f.q);
    f.area2 = sqrt(dot(c, c));
    f.width = sqrt(pp);
    f.side = sqrt(dot(f.d, f.d));
    f.valid = f.area2 > real(1e-6) * (pp + qq) && f.area2 > real(1e-15);
    f.T = (v0 + v1 + v2) * real(1.0 / 3);
    if (f.valid) {
        f.a = f.p * (1 / f.width);
        f.n = c * (1 / f.area2);
        f.b = cross(f.a, f.n);
        f.height = f.area2 / f.side;
        f.k = 10 * (f.height + f.side);
    } else {
        f.a = {1, 0, 0};
        f.n = {0, 1, 0};
        f.b = {0, 0, 1};
        f.height = f.k = 0;
    }
    return f;
}

// A quaternion's rotation by columns, the unit quaternion, its length (0: no rotation).
template <class real> struct Turn { Vec<real> column[3]; real w, x, y, z, length; };

template <class real> FORMULA Turn<real> turn_of(real w, real x, real y, real z) {
    Turn<real> t;
    t.length = sqrt(w * w + x * x + y * y + z * z);
    if (t.length > real(1e-12)) {
        real inverse = 1 / t.length;
        w *= inverse; x *= inverse; y *= inverse; z *= inverse;
    } else {
        t.length = 0;
        w = 1; x = y = z = 0;
    }
    t.w = w; t.x = x; t.y = y; t.z = z;
    t.column[0] = {1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)};
    t.column[1] = {2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)};
    t.column[2] = {2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)};
    return t;
}

// A bound gaussian: mean, rotation by columns, standard deviations; its gradient has the same shape.
template <class real> struct Bound { Vec<real> mean, column[3]; real scale[3]; };

template <class real> FORMULA Vec<real> on_axes(const Face<real> &f, Vec<real> v) { return f.a * v.x + f.n * v.y + f.b * v.z; }

template <class real> FORMULA Bound<real> bind(const Face<real> &f, const Turn<real> &t, Vec<real> mu, const real *log_scale) {
    Bound<real> out;
    out.mean = on_axes(f, mu) * f.k + f.T;
    for (int j = 0; j < 3; ++j) {
        out.column[j] = on_axes(f, t.column[j]);
        out.scale[j] = f.k * exp(log_scale[j]);
    }
    return out;
}

template <class real> struct BindGradient { Vec<real> mu; real quat[4], log_scale[3]; Vec<real> corner[3]; };

template <class real>
FORMULA BindGradient<real> bind_backward(const Face<real> &f, const Turn<real> &t, Vec<real> mu, const real *log_scale,
                                         const Bound<real> &grad) {
    BindGradient<real> out;
    Vec<real> g = grad.mean, u = {dot(f.a, g), dot(f.n, g), dot(f.b, g)};
    out.mu = u * f.k;
    real gk = dot(mu, u);
    for (int j = 0; j < 3; ++j) {
        real s = exp(log_scale[j]);
        gk += grad.scale[j] * s;
        out.log_scale[j] = grad.scale[j] * s * f.k;
    }
    if (t.length > 0) {
        real m[3][3];  // gradient of the local rotation, row: axis, column: j
        for (int j = 0; j < 3; ++j) {
            m[0][j] = dot(f.a, grad.column[j]);
            m[1][j] = dot(f.n, grad.column[j]);
            m[2][j] = dot(f.b, grad.column[j]);
        }
        real w = t.w, x = t.x, y = t.y, z = t.z;
        real gw = 2 * (x * (m[2][1] - m[1][2]) + y * (m[0][2] - m[2][0]) + z * (m[1][0] - m[0][1]));
        real gx = 2 * (w * (m[2][1] - m[1][2]) + y * (m[0][1] + m[1][0]) + z * (m[0][2] + m[2][0]) - 2 * x * (m[1][1] + m[2][2]));
        real gy = 2 * (w * (m[0][2] - m[2][0]) + x * (m[0][1] + m[1][0]) + z * (m[1][2] + m[2][1]) - 2 * y * (m[0][0] + m[2][2]));
        real gz = 2 * (w * (m[1][0] - m[0][1]) + x * (m[0][2] + m[2][0]) + y * (m[1][2] + m[2][1]) - 2 * z * (m[0][0] + m[1][1]));
        real along = gw * w + gx * x + gy * y + gz * z;
        out.quat[0] = (gw - along * w) / t.length;
        out.quat[1] = (gx - along * x) / t.length;
        out.quat[2] = (gy - along * y) / t.length;
        out.quat[3] = (gz - along * z) / t.length;
    } else {
        for (int i = 0; i < 4; ++i) out.quat[i] = 0;
    }
    Vec<real> third = g * real(1.0 / 3);
    if (!f.valid) {
        out.corner[0] = out.corner[1] = out.corner[2] = third;
        return out;
    }
    Vec<real> A = g * (f.k * mu.x), N = g * (f.k * mu.y), B = g * (f.k * mu.z);
    for (int j = 0; j < 3; ++j) {
        A = A + grad.column[j] * t.column[j].x;
        N = N + grad.column[j] * t.column[j].y;
        B = B + grad.column[j] * t.column[j].z;
    }
    A = A + cross(f.n, B);  // b = a x n
    N = N + cross(B, f.a);
    gk *= 10;  // k = 10 (|c| / L + L), n = c / |c|
    Vec<real> C = (N - f.n * dot(f.n, N)) * (1 / f.area2) + f.n * (gk / f.side);
    Vec<real> D = f.d * (gk * (1 - f.height / f.side) / f.side);
    Vec<real> P = (A - f.a * dot(f.a, A)) * (1 / f.width) + cross(f.q, C) - D;  // a = p / |p|, c = p x q, d = q - p
    Vec<real> Q = cross(C, f.p) + D;
    out.corner[0] = Q + third;
    out.corner[1] = third - P - Q;
    out.corner[2] = P + third;
    return out;
}

// Where a window of `size` px about `centre` begins, moved into a frame of `whole` px.
template <class real> FORMULA int window_begin(real centre, int size, int whole) {
    return int(floor(fmin(fmax(centre - size * real(0.5), real(0)), real(whole - size))));
}

// px2, keeps_energy: of the low-pass (avatar/draw_rule.py).
template <class real> struct Lens { real fx, fy, cx, cy, width, height, px2; bool keeps_energy; };

// Factor of the clip's light on a colour channel of a face (avatar/light.py); light: 4 rows of 3; n: normal, camera frame.
template <class real> FORMULA real shade_of(const real *light, Vec<real> n, int channel) {
    const real *l = light + channel;
    return fmin(fmax(l[0] + l[3] * n.x - l[6] * n.y + l[9] * fmax(n.z, -n.z), real(DARKEST)), real(BRIGHTEST));
}

// Slopes of the projection at a point clamped to the grown frustum, and the rows of A = J R diag(s).
template <class real> struct Rows { real jx, jy, u, v, a[3], b[3]; bool inside_u, inside_v; };

template <class real> FORMULA Rows<real> rows_of(const Lens<real> &lens, const Bound<real> &g) {
    Rows<real> r;
    real u = g.mean.x / g.mean.z, v = g.mean.y / g.mean.z;
    real margin_x = real(0.5 * FRUSTUM) * lens.width / lens.fx, margin_y = real(0.5 * FRUSTUM) * lens.height / lens.fy;
    real low_u = -lens.cx / lens.fx - margin_x, high_u = (lens.width - lens.cx) / lens.fx + margin_x;
    real low_v = -lens.cy / lens.fy - margin_y, high_v = (lens.height - lens.cy) / lens.fy + margin_y;
    r.inside_u = low_u <= u && u <= high_u;
    r.inside_v = low_v <= v && v <= high_v;
    r.jx = lens.fx / g.mean.z;
    r.jy = lens.fy / g.mean.z;
    r.u = fmin(fmax(u, low_u), high_u);
    r.v = fmin(fmax(v, low_v), high_v);
    for (int j = 0; j < 3; ++j) {
        r.a[j] = r.jx * (g.column[j].x - r.u * g.column[j].z) * g.scale[j];
        r.b[j] = r.jy * (g.column[j].y - r.v * g.column[j].z) * g.scale[j];
    }
    return r;
}

// Covariance of a splat without the low-pass, and its determinant as a sum of squares: thin splats lose no digits.
template <class real> struct Covariance { real xx, xy, yy, determinant; };

template <class real> FORMULA Covariance<real> covariance_of(const Rows<real> &r) {
    Covariance<real> c = {0, 0, 0, 0};
    for (int j = 0; j < 3; ++j) {
        c.xx += r.a[j] * r.a[j];
        c.xy += r.a[j] * r.b[j];
        c.yy += r.b[j] * r.b[j];
    }
    real m0 = r.a[1] * r.b[2] - r.a[2] * r.b[1], m1 = r.a[2] * r.b[0] - r.a[0] * r.b[2], m2 = r.a[0] * r.b[1] - r.a[1] * r.b[0];
    c.determinant = m0 * m0 + m1 * m1 + m2 * m2;
    return c;
}

// Centre (px), exponent s = ha dx^2 + b dx dy + hc dy^2, its largest value, half extents (px), opacity after the low-pass.
template <class real> struct Splat { real x, y, ha, b, hc, s_max, wide, high, opacity; bool seen; };

template <class real> FORMULA Splat<real> project(const Lens<real> &lens, const Bound<real> &g, real opacity) {
    Splat<real> s;
    s.seen = g.mean.z > real(NEAR_PLANE) && g.mean.z < real(1e6) && opacity > real(MIN_ALPHA) && opacity < real(1e6);
    if (!s.seen) return s;
    Covariance<real> bare = covariance_of(rows_of(lens, g));
    real determinant = bare.determinant + lens.px2 * (bare.xx + bare.yy) + lens.px2 * lens.px2;
    real xx = bare.xx + lens.px2, yy = bare.yy + lens.px2;
    s.opacity = lens.keeps_energy ? opacity * sqrt(bare.determinant / determinant) : opacity;
    s.x = g.mean.x / g.mean.z * lens.fx + lens.cx;
    s.y = g.mean.y / g.mean.z * lens.fy + lens.cy;
    s.ha = yy / (2 * determinant);
    s.b = -bare.xy / determinant;
    s.hc = xx / (2 * determinant);
    s.s_max = log(real(ALPHA_LEVELS) * s.opacity);
    s.wide = sqrt(2 * s.s_max * xx);
    s.high = sqrt(2 * s.s_max * yy);
    s.seen = s.opacity > real(MIN_ALPHA) && determinant < real(1e30) && xx < real(1e15) && yy < real(1e15) &&
             s.x < real(1e7) && s.x > real(-1e7) && s.y < real(1e7) && s.y > real(-1e7);
    return s;
}

// moments: sums over pixels of g, g dx, g dy, g dx^2, g dx dy, g dy^2 with g = dL/d(-s).
template <class real>
FORMULA Bound<real> project_backward(const Lens<real> &lens, const Bound<real> &g, const Splat<real> &s, const real *moments) {
    Bound<real> out;
    real a = 2 * s.ha, b = s.b, c = 2 * s.hc;
    real ux = a * moments[1] + b * moments[2], uy = b * moments[1] + c * moments[2];
    real k00 = moments[3] / 2, k01 = moments[4] / 2, k11 = moments[5] / 2;
    real m00 = a * k00 + b * k01, m01 = a * k01 + b * k11, m10 = b * k00 + c * k01, m11 = b * k01 + c * k11;
    real h00 = m00 * a + m01 * b, h01 = m00 * b + m01 * c, h11 = m10 * b + m11 * c;
    Rows<real> r = rows_of(lens, g);
    if (lens.keeps_energy) {
        // the opacity's factor sqrt(bare / determinant) has the slope (C^-1 - Q) / 2 in its logarithm, C without the low-pass
        Covariance<real> bare = covariance_of(r);
        real half = moments[0] / 2;
        h00 += half * (bare.yy / bare.determinant - a);
        h01 -= half * (bare.xy / bare.determinant + b);
        h11 += half * (bare.xx / bare.determinant - c);
    }
    real gjx = 0, gjy = 0, t2x = 0, t2y = 0;
    for (int j = 0; j < 3; ++j) {
        real A = 2 * (h00 * r.a[j] + h01 * r.b[j]), B = 2 * (h01 * r.a[j] + h11 * r.b[j]);
        Vec<real> W = {r.jx * A, r.jy * B, 0};
        W.z = -r.u * W.x - r.v * W.y;
        out.column[j] = W * g.scale[j];
        out.scale[j] = dot(W, g.column[j]);
        Vec<real> w = g.column[j] * g.scale[j];
        gjx += A * (w.x - r.u * w.z);
        gjy += B * (w.y - r.v * w.z);
        t2x += A * w.z;
        t2y += B * w.z;
    }
    real gu = (r.inside_u ? -r.jx * t2x : real(0)) + lens.fx * ux, gv = (r.inside_v ? -r.jy * t2y : real(0)) + lens.fy * uy;
    real z = 1 / g.mean.z;
    out.mean = {gu * z, gv * z, -(gu * g.mean.x * z + gv * g.mean.y * z + gjx * r.jx + gjy * r.jy) * z};
    return out;
}

#ifdef __CUDACC__
FORMULA float falloff(float s) { return __expf(-s); }
FORMULA float quotient(float a, float b) { return __fdividef(a, b); }
#endif
FORMULA double falloff(double s) { return exp(-s); }
FORMULA double quotient(double a, double b) { return a / b; }

// Alpha of one gaussian at one pixel, 0 outside its rim.
template <class real> FORMULA real alpha_of(real s, real s_max, real opacity, bool &clipped) {
    real raw = opacity * falloff(s);
    clipped = raw > real(MAX_ALPHA);
    return s <= s_max ? fmin(raw, real(MAX_ALPHA)) : real(0);
}

// Its weight in the pixel. T: transmittance, 0 once stopped; is moved on.
template <class real> FORMULA real composite(real a, real &T) {
    real weight = T * a, after = T - weight;
    bool stopped = after <= real(STOP);
    T = stopped ? real(0) : after;
    return stopped ? real(0) : weight;
}

// colour: image gradient . (red, green, blue, 1); behind: what is still to come of (image gradient . colour), moved on.
template <class real> FORMULA real composite_backward(real weight, real a, bool clipped, real colour, real &behind) {
    real own = weight * colour;
    behind -= own;
    return weight > 0 && !clipped ? own - quotient(a * behind, 1 - a) : real(0);
}

// sin t / t, (1 - cos t) / t^2 and the derivative of each by t, divided by t.
FORMULA void turn_coefficients(double t2, double *c) {
    if (t2 < 1e-4) {
        c[0] = 1 - t2 / 6 + t2 * t2 / 120;
        c[1] = 0.5 - t2 / 24 + t2 * t2 / 720;
        c[2] = -1.0 / 3 + t2 / 30;
        c[3] = -1.0 / 12 + t2 / 180;
        return;
    }
    double t = sqrt(t2), s = sin(t), k = cos(t);
    c[0] = s / t;
    c[1] = (1 - k) / t2;
    c[2] = (t * k - s) / (t2 * t);
    c[3] = (t * s - 2 * (1 - k)) / (t2 * t2);
}

// Rotation vector to matrix (row by row), float64 for the small angles' sake.
template <class real> FORMULA void rodrigues(const double *w, real *m) {
    double x = w[0], y = w[1], z = w[2], t2 = x * x + y * y + z * z, c[4];
    turn_coefficients(t2, c);
    double a = c[0], b = c[1];
    m[0] = real(1 + b * (x * x - t2));
    m[4] = real(1 + b * (y * y - t2));
    m[8] = real(1 + b * (z * z - t2));
    m[1] = real(b * x * y - a * z);
    m[3] = real(b * x * y + a * z);
    m[2] = real(b * x * z + a * y);
    m[6] = real(b * x * z - a * y);
    m[5] = real(b * y * z - a * x);
    m[7] = real(b * y * z + a * x);
}

template <class real> FORMULA void rodrigues_backward(const double *w, const real *m, double *out) {
    double t2 = w[0] * w[0] + w[1] * w[1] + w[2] * w[2], c[4];
    turn_coefficients(t2, c);
    double trace = double(m[0]) + m[4] + m[8];
    double skew[3] = {double(m[7]) - m[5], double(m[2]) - m[6], double(m[3]) - m[1]};
    double on_k = 0, on_k2 = -t2 * trace;
    for (int i = 0; i < 3; ++i) {
        on_k += w[i] * skew[i];
        for (int k = 0; k < 3; ++k) on_k2 += w[i] * m[3 * i + k] * w[k];
    }
    for (int i = 0; i < 3; ++i) {
        double turn = -2 * trace * w[i];
        for (int k = 0; k < 3; ++k) turn += (double(m[3 * i + k]) + m[3 * k + i]) * w[k];
        out[i] = (c[2] * on_k + c[3] * on_k2) * w[i] + c[0] * skew[i] + c[1] * turn;
    }
}

// Adam (0.9, 0.99) of one row whose gradient is not zero; n: steps of the row so far, this one counted.
template <class real> FORMULA void adam_row(real *value, const real *grad, real *first, real *second, int size, int n, real rate) {
    bool touched = false;
    for (int c = 0; c < size; ++c) touched = touched || grad[c] != 0;
    if (!touched) return;
    n = n > 0 ? n : 1;
    real scale = rate / (1 - pow(real(0.9), real(n))), unbias = 1 / (1 - pow(real(0.99), real(n)));
    for (int c = 0; c < size; ++c) {
        first[c] += real(0.1) * (grad[c] - first[c]);
        second[c] += real(0.01) * (grad[c] * grad[c] - second[c]);
        value[c] -= scale * first[c] / (sqrt(second[c] * unbias) + real(1e-15));
    }
}

// Adam (0.9, 1 - fresh, tiny) of one number that is pulled to zero; n: steps so far, this one counted.
template <class real>
FORMULA void adam_pulled(real &value, real grad, real &first, real &second, int n, real rate, real pull, real unit,
                         real fresh = real(0.01), real tiny = real(1e-12)) {
    grad += 2 * pull * value / (unit * unit);
    first += real(0.1) * (grad - first);
    second += fresh * (grad * grad - second);
    value -= rate * (first / (1 - pow(real(0.9), real(n)))) / (sqrt(second / (1 - pow(1 - fresh, real(n)))) + tiny);
}

// Bounds of stages/train/gaussians/kernels.py `limit`, for one gaussian.
template <class real> struct Bounds { real needle, least, largest, reach, tie; bool tied; };

template <class real>
FORMULA void limit(real *mu, real *quat, real *log_scale, real *rgb, real &logit, const real *start, real face_scale,
                   const Bounds<real> &bounds, real pull) {
    real far = bounds.reach;
    if (bounds.tied) {
        far = fmin(far, bounds.tie);
        quat[1] = quat[3] = 0;
        log_scale[1] = fmin(log_scale[1], fmin(log_scale[0], log_scale[2]) + log(real(0.4)));
    }
    real norm = quat[0] * quat[0] + quat[1] * quat[1] + quat[2] * quat[2] + quat[3] * quat[3];
    norm = norm > real(1e-20) ? 1 / sqrt(norm) : real(0);
    for (int c = 0; c < 4; ++c) quat[c] *= norm;
    if (norm == 0) quat[0] = 1;
    real a = log_scale[0], b = log_scale[1], d = log_scale[2];
    real high = fmax(a, fmax(b, d)), low = fmin(a, fmin(b, d)), middle = a + b + d - high - low;
    real size = fmax(face_scale, real(1e-6));
    real top = fmin(high, fmin(middle + log(bounds.needle), log(bounds.largest / size)));
    real bottom = fmax(top - log(real(10)), log(bounds.least / size));
    for (int c = 0; c < 3; ++c) log_scale[c] = fmax(fmin(log_scale[c], top), bottom);
    real away = 0;
    for (int c = 0; c < 3; ++c) {
        mu[c] -= pull * (mu[c] - start[c]);
        away += (mu[c] - start[c]) * (mu[c] - start[c]);
    }
    away = sqrt(away) * face_scale;
    if (away > far)
        for (int c = 0; c < 3; ++c) mu[c] = start[c] + (mu[c] - start[c]) * far / away;
    for (int c = 0; c < 3; ++c) rgb[c] = fmin(fmax(rgb[c], real(0)), real(1));
    logit = fmin(fmax(logit, real(-9)), real(9));
}
