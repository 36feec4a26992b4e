// The kernels' formulas over arrays, float64, for test_formulas.py.
#include "formulas.cuh"
#include "paper_formulas.cuh"

typedef Vec<double> V;
static V vec(const double *p) { return {p[0], p[1], p[2]}; }
static void put(double *p, V v) { p[0] = v.x; p[1] = v.y; p[2] = v.z; }
static Lens<double> lens_of(const double *l) { return {l[0], l[1], l[2], l[3], l[4], l[5], l[6], l[7] != 0}; }
static Bound<double> bound_of(const double *mean, const double *rotation, const double *scale) {
    Bound<double> g;
    g.mean = vec(mean);
    for (int j = 0; j < 3; ++j) {
        g.column[j] = {rotation[j], rotation[3 + j], rotation[6 + j]};
        g.scale[j] = scale[j];
    }
    return g;
}
static void put_bound(const Bound<double> &g, double *mean, double *rotation, double *scale) {
    put(mean, g.mean);
    for (int j = 0; j < 3; ++j) {
        rotation[j] = g.column[j].x;
        rotation[3 + j] = g.column[j].y;
        rotation[6 + j] = g.column[j].z;
        scale[j] = g.scale[j];
    }
}

extern "C" {
void bind_all(int n, const double *corners, const double *mu, const double *quat, const double *log_scale, double *means,
              double *rotations, double *scales, const double *gm, const double *gr, const double *gs, double *gmu, double *gquat,
              double *glog, double *gcorners) {
    for (int i = 0; i < n; ++i) {
        Face<double> f = face_frame(vec(corners + 9 * i), vec(corners + 9 * i + 3), vec(corners + 9 * i + 6));
        Turn<double> t = turn_of(quat[4 * i], quat[4 * i + 1], quat[4 * i + 2], quat[4 * i + 3]);
        put_bound(bind(f, t, vec(mu + 3 * i), log_scale + 3 * i), means + 3 * i, rotations + 9 * i, scales + 3 * i);
        BindGradient<double> g = bind_backward(f, t, vec(mu + 3 * i), log_scale + 3 * i, bound_of(gm + 3 * i, gr + 9 * i, gs + 3 * i));
        put(gmu + 3 * i, g.mu);
        for (int c = 0; c < 4; ++c) gquat[4 * i + c] = g.quat[c];
        for (int c = 0; c < 3; ++c) {
            glog[3 * i + c] = g.log_scale[c];
            put(gcorners + 9 * i + 3 * c, g.corner[c]);
        }
    }
}

void shade_all(int n, const double *light, const double *normals, double *out) {
    for (int i = 0; i < 3 * n; ++i) out[i] = shade_of(light, vec(normals + i / 3 * 3), i % 3);
}

void project_all(int n, const double *lens, const double *means, const double *rotations, const double *scales,
                 const double *opacity, double *splats, int *seen) {
    for (int i = 0; i < n; ++i) {
        Splat<double> s = project(lens_of(lens), bound_of(means + 3 * i, rotations + 9 * i, scales + 3 * i), opacity[i]);
        seen[i] = s.seen;
        const double row[8] = {s.x, s.y, s.ha, s.b, s.hc, s.s_max, s.wide, s.high};
        for (int c = 0; s.seen && c < 8; ++c) splats[8 * i + c] = row[c];
    }
}

// Composites gaussians given front to back over every pixel, and takes the image's gradient back to all that was given.
void render_all(int n, const double *lens, const double *means, const double *rotations, const double *scales, const double *rgb,
                const double *opacity, const double *grad_image, double *image, double *gm, double *gr, double *gs, double *grgb,
                double *go) {
    int width = int(lens[4]), height = int(lens[5]);
    double *moments = new double[9 * n]();
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            double *out = image + 4 * (y * width + x);
            const double *v = grad_image + 4 * (y * width + x);
            double T = 1, behind = 0;
            for (int c = 0; c < 4; ++c) out[c] = 0;
            for (int pass = 0; pass < 2; ++pass) {
                T = 1;
                for (int i = 0; i < n; ++i) {
                    Splat<double> s = project(lens_of(lens), bound_of(means + 3 * i, rotations + 9 * i, scales + 3 * i), opacity[i]);
                    if (!s.seen) continue;
                    double dx = x + 0.5 - s.x, dy = y + 0.5 - s.y;
                    bool clipped;
                    double a = alpha_of(dx * (dx * s.ha + dy * s.b) + dy * dy * s.hc, s.s_max, s.opacity, clipped);
                    double weight = composite(a, T);
                    const double *c = rgb + 3 * i;
                    if (pass == 0) {
                        for (int k = 0; k < 3; ++k) out[k] += weight * c[k];
                        out[3] += weight;
                        continue;
                    }
                    double g = composite_backward(weight, a, clipped, v[0] * c[0] + v[1] * c[1] + v[2] * c[2] + v[3], behind);
                    const double row[9] = {g, g * dx, g * dy, g * dx * dx, g * dx * dy, g * dy * dy,
                                           weight * v[0], weight * v[1], weight * v[2]};
                    for (int k = 0; k < 9; ++k) moments[9 * i + k] += row[k];
                }
                behind = v[0] * out[0] + v[1] * out[1] + v[2] * out[2] + v[3] * out[3];
            }
        }
    for (int i = 0; i < n; ++i) {
        Bound<double> g = bound_of(means + 3 * i, rotations + 9 * i, scales + 3 * i), zero = {};
        Splat<double> s = project(lens_of(lens), g, opacity[i]);
        put_bound(s.seen ? project_backward(lens_of(lens), g, s, moments + 9 * i) : zero, gm + 3 * i, gr + 9 * i, gs + 3 * i);
        for (int c = 0; c < 3; ++c) grgb[3 * i + c] = moments[9 * i + 6 + c];
        go[i] = moments[9 * i] / opacity[i];
    }
    delete[] moments;
}

void turn_all(int n, const double *pose, double *matrices, const double *grad, double *grad_pose) {
    for (int i = 0; i < n; ++i) {
        rodrigues(pose + 3 * i, matrices + 9 * i);
        rodrigues_backward(pose + 3 * i, grad + 9 * i, grad_pose + 3 * i);
    }
}

void adam_all(int n, int size, double *value, const double *grad, double *first, double *second, const long long *count, double rate) {
    for (int i = 0; i < n; ++i)
        adam_row(value + size * i, grad + size * i, first + size * i, second + size * i, size, int(count[i]), rate);
}

// Recipe `paper`: logits of scales to their logarithms and slopes; gradient of the neighbours' deviations, each in one column.
void scale_all(int n, const double *logit, double largest, double *log_scale, double *slope) {
    for (int i = 0; i < n; ++i) {
        log_scale[i] = log_scale_of(logit[i], largest);
        slope[i] = log_scale_slope(logit[i]);
    }
}

double spread_all(int n, int columns, const double *values, const long long *index, double weight, double *grad) {
    double value = 0;
    for (int i = 0; i < n; ++i)
        for (int c = 0; c < columns; ++c) {
            double own[NEAREST], mean, slope;
            for (int k = 0; k < NEAREST; ++k) own[k] = values[index[NEAREST * i + k] * columns + c];
            value += weight * spread(own, weight, mean, slope);
            for (int k = 0; k < NEAREST; ++k) grad[index[NEAREST * i + k] * columns + c] += slope * (own[k] - mean);
        }
    return value;
}

// Quaternions of rotations, and their gradient as one by the rotations.
void quat_all(int n, const double *rotations, const double *grad, double *quats, double *out) {
    for (int i = 0; i < n; ++i) {
        V column[3];
        for (int j = 0; j < 3; ++j) column[j] = {rotations[9 * i + j], rotations[9 * i + 3 + j], rotations[9 * i + 6 + j]};
        quat_of(column, quats + 4 * i);
        through_quat(quats + 4 * i, grad + 4 * i, column);
        for (int j = 0; j < 3; ++j) {
            out[9 * i + j] = column[j].x;
            out[9 * i + 3 + j] = column[j].y;
            out[9 * i + 6 + j] = column[j].z;
        }
    }
}

double edges_all(int height, int width, const double *image, const double *target, double weight, double *grad) {
    double loss = 0;
    auto at = [&](const double *from, int x, int y) {
        const double *p = from + 3 * (y * width + x);
        return x < 0 || y < 0 || x >= width || y >= height ? 0.0 : grey(p[0], p[1], p[2]);
    };
    auto add = [&](int x, int y, double g) {
        if (x < 0 || y < 0 || x >= width || y >= height) return;
        const double part[3] = {grey(1.0, 0.0, 0.0), grey(0.0, 1.0, 0.0), grey(0.0, 0.0, 1.0)};
        for (int c = 0; c < 3; ++c) grad[3 * (y * width + x) + c] += g * part[c];
    };
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            double across = at(image, x + 1, y) - at(image, x - 1, y), down = at(image, x, y + 1) - at(image, x, y - 1);
            double own = strength(across, down);
            double real = strength(at(target, x + 1, y) - at(target, x - 1, y), at(target, x, y + 1) - at(target, x, y - 1));
            double slope = strength_slope(own, real, weight);
            loss += weight * fabs(own - real);
            add(x + 1, y, slope * across);
            add(x - 1, y, -slope * across);
            add(x, y + 1, slope * down);
            add(x, y - 1, -slope * down);
        }
    return loss;
}

double dice_all(int n, const double *alpha, const double *mask, double outside, double weight, double *grad) {
    double shown = 0, masked = 0, both = 0, squared = 0;
    for (int i = 0; i < n; ++i) {
        squared += mask[i] * mask[i];
        shown += alpha[i];
        masked += mask[i];
        both += alpha[i] * mask[i];
    }
    Dice found = dice_of(n + outside, shown, masked, both, squared, weight);
    for (int i = 0; i < n; ++i) grad[i] = found.by_clear * (1 - mask[i]);
    return found.value;
}

void adam_pulled_all(int n, double *value, const double *grad, double *first, double *second, int steps, double rate, double pull,
                     double unit) {
    for (int i = 0; i < n; ++i) adam_pulled(value[i], grad[i], first[i], second[i], steps, rate, pull, unit);
}

void window_all(int n, const double *centre, int size, int whole, int *out) {
    for (int i = 0; i < n; ++i) out[i] = window_begin(centre[i], size, whole);
}

void square_window_all(int n, const double *centre, int size, int whole, int *out) {
    for (int i = 0; i < n; ++i) out[i] = square_window_begin(centre[i], size, whole);
}

void adam_dense(int n, double *value, const double *grad, double *first, double *second, int steps, double rate) {
    double begun = rate / (1 - pow(0.9, steps)), unbias = 1 / (1 - pow(0.999, steps));
    for (int i = 0; i < n; ++i) adam_value(value[i], grad[i], first[i], second[i], begun, unbias);
}

void limit_all(int n, double *mu, double *quat, double *log_scale, double *rgb, double *logit, const double *start,
               const double *face_scale, const double *largest, const int *tied, double needle, double least, double reach,
               double tie, double pull) {
    for (int i = 0; i < n; ++i) {
        Bounds<double> bounds = {needle, least, largest[i], reach, tie, tied[i] != 0};
        limit(mu + 3 * i, quat + 4 * i, log_scale + 3 * i, rgb + 3 * i, logit[i], start + 3 * i, face_scale[i], bounds, pull);
    }
}
}
