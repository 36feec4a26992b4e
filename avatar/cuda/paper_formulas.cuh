// Formulas that only recipe `paper` has, of one gaussian, one neighbourhood, one pixel and one frame. As formulas.cuh, the kernels
// and the host test compile this same text; on the CPU it is stages/train/paper/.
#pragma once

constexpr int NEAREST = 3;  // gaussians of a neighbourhood

// Scales are largest * sigmoid(logit): the logarithm, and its slope by the logit.
template <class real> FORMULA real log_scale_of(real logit, real largest) { return log(largest) - log(1 + exp(-logit)); }
template <class real> FORMULA real log_scale_slope(real logit) { return 1 / (1 + exp(logit)); }

template <class real> FORMULA real grey(real red, real green, real blue) {
    return (real(65.738) * red + real(129.057) * green + real(25.064) * blue) / 256;
}

// Strength of the grey image's edge from its differences across and down.
template <class real> FORMULA real strength(real across, real down) { return sqrt(across * across + down * down + real(1e-6)); }

// Slope of weight * |own - target| by a difference of the render, over that difference.
template <class real> FORMULA real strength_slope(real own, real target, real weight) {
    return own == target ? real(0) : (own > target ? weight : -weight) / own;
}

// Dice of the background over a batch of `area` pixels, from sums of alpha, mask, their product and the squared mask. Its slope by
// the alpha of a pixel is by_clear * (1 - mask).
struct Dice { double value, by_clear; };

FORMULA Dice dice_of(double area, double shown, double masked, double both, double squared, double weight) {
    double clear = area - shown - masked + both, squares = area - 2 * masked + squared, either = clear + squares + 1;
    return {weight * (1 - (2 * clear + 1) / either), weight * (2 * squares + 1) / (either * either)};
}

// The quaternion of a rotation by columns, wxyz, that has w >= 0.
template <class real> FORMULA void quat_of(const Vec<real> *column, real *q) {
    Vec<real> a = column[0], b = column[1], c = column[2];
    const real size[4] = {a.x + b.y + c.z, a.x - b.y - c.z, b.y - a.x - c.z, c.z - a.x - b.y};
    const real x = b.z - c.y, y = c.x - a.z, z = a.y - b.x, xy = b.x + a.y, xz = c.x + a.z, yz = c.y + b.z;
    int largest = 0;
    for (int k = 1; k < 4; ++k)
        if (size[k] > size[largest]) largest = k;
    real own = sqrt(1 + size[largest]) / 2, f = 1 / (4 * own);
    q[0] = largest == 0 ? own : (largest == 1 ? x : largest == 2 ? y : z) * f;
    q[1] = largest == 1 ? own : (largest == 0 ? x : largest == 2 ? xy : xz) * f;
    q[2] = largest == 2 ? own : (largest == 0 ? y : largest == 1 ? xy : yz) * f;
    q[3] = largest == 3 ? own : (largest == 0 ? z : largest == 1 ? xz : yz) * f;
    if (q[0] < 0)
        for (int k = 0; k < 4; ++k) q[k] = -q[k];
}

// The gradient by a quaternion as one by the columns of its rotation: right for turns of the rotation.
template <class real> FORMULA void through_quat(const real *q, const real *grad, Vec<real> *column) {
    Vec<real> v = {q[1], q[2], q[3]}, g = {grad[1], grad[2], grad[3]};
    Vec<real> turn = (g * q[0] - v * grad[0] + cross(v, g)) * real(0.25);
    for (int j = 0; j < 3; ++j) column[j] = cross(turn, column[j]);
}

// Where HAHA's window of `size` px about `centre` begins, in a square of `whole` px.
template <class real> FORMULA int square_window_begin(real centre, int size, int whole) {
    int half = size / 2, middle = int(centre);
    middle = middle < half ? half : middle;
    middle = middle > whole - half - 1 ? whole - half - 1 : middle;
    return middle > half ? middle - half : 0;
}

// Mean of a neighbourhood's values; slope of weight * their standard deviation by a value, over (value - mean). Returns the deviation.
template <class real> FORMULA real spread(const real *value, real weight, real &mean, real &slope) {
    mean = 0;
    for (int k = 0; k < NEAREST; ++k) mean += value[k] / NEAREST;
    real square = 0;
    for (int k = 0; k < NEAREST; ++k) square += (value[k] - mean) * (value[k] - mean);
    real deviation = sqrt(square / (NEAREST - 1));
    slope = deviation < real(1e-9) ? real(0) : weight / ((NEAREST - 1) * deviation);
    return deviation;
}

// Adam (0.9, 0.999, 1e-8) of one number; rate and unbias: already divided by 1 - 0.9^n and 1 - 0.999^n.
template <class real> FORMULA void adam_value(real &value, real grad, real &first, real &second, real rate, real unbias) {
    first += real(0.1) * (grad - first);
    second += real(0.001) * (grad * grad - second);
    value -= rate * first / (sqrt(second * unbias) + real(1e-8));
}
