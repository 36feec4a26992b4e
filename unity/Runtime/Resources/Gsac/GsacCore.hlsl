// The arithmetic of a bound gaussian, in plain HLSL: no buffers, no pipeline's includes, no wave operations.
// Formulas: docs/gsac-format.md, "From file to picture". The same text serves mirrored (Unity) and canonical data.
#ifndef GSAC_CORE_INCLUDED
#define GSAC_CORE_INCLUDED

#define GSAC_NEAR 0.01
#define GSAC_WIDE 1.3
#define GSAC_DARKEST 0.25
#define GSAC_BRIGHTEST 2.5
#define GSAC_GAMMA 2.2 // a factor of linear light is this root of it in display colours
// Display values of what lies behind for which an edge is exact where nobody knows what lies there, and for which its light is.
#define GSAC_DARK_BEHIND 0.05
#define GSAC_BRIGHT_BEHIND 0.85
#define GSAC_USUAL_BEHIND 0.1

// The frame of a face: orthonormal a, n, b, its centre, its size k (0 where it has no area).
struct GsacFrame
{
    float3 a;
    float3 n;
    float3 b;
    float3 centre;
    float k;
};

GsacFrame GsacFaceFrame(float3 v0, float3 v1, float3 v2)
{
    GsacFrame f;
    float3 p = v2 - v1;
    float3 q = v0 - v1;
    float3 c = cross(p, q);
    float area2 = length(c);
    f.centre = v1 + (p + q) * (1.0 / 3.0);
    f.a = float3(1, 0, 0);
    f.n = float3(0, 1, 0);
    f.b = float3(0, 0, 1);
    f.k = 0;
    if (area2 > 1e-6 * (dot(p, p) + dot(q, q)) && area2 > 1e-15)
    {
        float side = length(q - p);
        f.a = p / length(p);
        f.n = c / area2;
        f.b = cross(f.a, f.n);
        f.k = 10 * (area2 / side + side);
    }
    return f;
}

// A gaussian in space: mean, the three axes of its rotation, standard deviations.
struct GsacBound
{
    float3 mean;
    float3 x;
    float3 y;
    float3 z;
    float3 scale;
};

float3 GsacTurn(GsacFrame f, float3 v)
{
    return f.a * v.x + f.n * v.y + f.b * v.z;
}

// quat: x y z w, unit; scale: standard deviations before the face's size.
GsacBound GsacBind(GsacFrame f, float3 mu, float4 quat, float3 scale)
{
    GsacBound g;
    float3 v = quat.xyz;
    float w = quat.w;
    float3 x = float3(1 - 2 * (v.y * v.y + v.z * v.z), 2 * (v.x * v.y + w * v.z), 2 * (v.x * v.z - w * v.y));
    float3 y = float3(2 * (v.x * v.y - w * v.z), 1 - 2 * (v.x * v.x + v.z * v.z), 2 * (v.y * v.z + w * v.x));
    float3 z = float3(2 * (v.x * v.z + w * v.y), 2 * (v.y * v.z - w * v.x), 1 - 2 * (v.x * v.x + v.y * v.y));
    g.mean = f.centre + f.k * GsacTurn(f, mu);
    g.x = GsacTurn(f, x);
    g.y = GsacTurn(f, y);
    g.z = GsacTurn(f, z);
    g.scale = f.k * scale;
    return g;
}

// What the light of the clip's room multiplies the colours on a face with; red, green, blue: of x, y, |z| of its normal and of 1.
float3 GsacLightOn(GsacFrame f, float4 red, float4 green, float4 blue)
{
    float4 n = float4(f.k > 0 ? float3(f.n.xy, abs(f.n.z)) : float3(0, 0, 0), 1);
    return clamp(float3(dot(red, n), dot(green, n), dot(blue, n)), GSAC_DARKEST, GSAC_BRIGHTEST);
}

// Light that a scene throws on a surface, of its normal: linear, as a factor of the surface's colour, in the second order that a
// diffuse surface needs (Ramamoorthi and Hanrahan 2001). red, green, blue: of x, y, z and 1.
struct GsacSceneLight
{
    float4 red;
    float4 green;
    float4 blue;
    float4 red2; // of xy, yz, zz, zx
    float4 green2;
    float4 blue2;
    float4 last; // of xx - yy; how far it stands in for the clip's light, 0..1
};

// What the scene's light multiplies display colours with.
float3 GsacSceneOn(GsacFrame f, GsacSceneLight s)
{
    float3 n = f.k > 0 ? f.n : float3(0, 0, 0);
    float4 one = float4(n, 1);
    float4 two = n.xyzz * n.yzzx;
    float3 light = float3(dot(s.red, one), dot(s.green, one), dot(s.blue, one))
        + float3(dot(s.red2, two), dot(s.green2, two), dot(s.blue2, two)) + s.last.rgb * (n.x * n.x - n.y * n.y);
    return min(pow(max(light, 1e-6), 1 / GSAC_GAMMA), GSAC_BRIGHTEST);
}

// Covariance: diagonal xx yy zz, rest xy xz yz.
void GsacCovariance(GsacBound g, out float3 diagonal, out float3 rest)
{
    float3 x = g.x * g.scale.x;
    float3 y = g.y * g.scale.y;
    float3 z = g.z * g.scale.z;
    diagonal = x * x + y * y + z * z;
    rest = x.xxy * x.yzz + y.xxy * y.yzz + z.xxy * z.yzz;
}

// Sort key: the farther, the smaller; equal depths keep the order of their numbers.
// range: nearest depth, quanta per metre; bits: how many low bits hold the number.
uint GsacSortKey(float depth, float2 range, uint bits, uint number)
{
    float top = exp2(32.0 - bits) - 1;
    float along = clamp((depth - range.x) * range.y, 0, 1);
    return ((uint)(top - floor(along * top)) << bits) | number;
}

// The ellipse of a gaussian on the screen, in pixels with x right and y up; kept: its area before the low-pass as a share of that after.
struct GsacEllipse
{
    float2 large;
    float2 small;
    float kept;
};

// row0..2: model to eye, eye axes x right, y up, z ahead; eye: the mean there; focal, screen: px;
// middle, extent: tangent of the frustum's middle and half width; lowPass: px^2.
GsacEllipse GsacProject(float3 row0, float3 row1, float3 row2, float3 eye, float3 diagonal, float3 rest,
                        float2 focal, float2 middle, float2 extent, float lowPass)
{
    float2 t = clamp(eye.xy / eye.z, middle - GSAC_WIDE * extent, middle + GSAC_WIDE * extent);
    float3 j0 = (row0 - t.x * row2) * (focal.x / eye.z);
    float3 j1 = (row1 - t.y * row2) * (focal.y / eye.z);
    float3 s0 = float3(diagonal.x * j0.x + rest.x * j0.y + rest.y * j0.z,
                       rest.x * j0.x + diagonal.y * j0.y + rest.z * j0.z,
                       rest.y * j0.x + rest.z * j0.y + diagonal.z * j0.z);
    float3 s1 = float3(diagonal.x * j1.x + rest.x * j1.y + rest.y * j1.z,
                       rest.x * j1.x + diagonal.y * j1.y + rest.z * j1.z,
                       rest.y * j1.x + rest.z * j1.y + diagonal.z * j1.z);
    float xx = dot(j0, s0);
    float xy = dot(j1, s0);
    float yy = dot(j1, s1);
    float bare = max(xx * yy - xy * xy, 0);
    float determinant = bare + lowPass * (xx + yy + lowPass);
    xx += lowPass;
    yy += lowPass;
    float mean = 0.5 * (xx + yy);
    float spread = length(float2(0.5 * (xx - yy), xy));
    float most = mean + spread;
    // determinant / largest keeps the digits that mean - spread loses
    float least = max(determinant / most, 1e-6);
    float2 axis = float2(1, 0);
    if (spread > 1e-6 * mean)
    {
        axis = normalize(xx > yy ? float2(most - yy, xy) : float2(xy, most - xx));
    }
    GsacEllipse e;
    e.large = sqrt(most) * axis;
    e.small = sqrt(least) * float2(-axis.y, axis.x);
    e.kept = sqrt(bare / max(determinant, 1e-12));
    return e;
}

// How many standard deviations away an opacity falls below the least alpha that is drawn.
float GsacReach(float opacity, float least)
{
    return sqrt(2 * log(max(opacity / least, 1))) + 1e-3;
}

// Premultiplied colour at `sigmas` standard deviations from the centre; blend: most alpha, least alpha.
float4 GsacShade(float2 sigmas, float4 colour, float2 blend)
{
    float alpha = min(blend.x, colour.a * exp(-0.5 * dot(sigmas, sigmas)));
    clip(alpha - blend.y);
    return float4(colour.rgb * alpha, alpha);
}

float3 GsacLinear(float3 c)
{
    float3 high = pow(max((c + 0.055) / 1.055, 0), 2.4);
    return float3(c.x > 0.04045 ? high.x : c.x / 12.92, c.y > 0.04045 ? high.y : c.y / 12.92,
                  c.z > 0.04045 ? high.z : c.z / 12.92);
}

float3 GsacDisplay(float3 c)
{
    float3 high = 1.055 * pow(max(c, 0), 1 / 2.4) - 0.055;
    return float3(c.x > 0.0031308 ? high.x : c.x * 12.92, c.y > 0.0031308 ? high.y : c.y * 12.92,
                  c.z > 0.0031308 ? high.z : c.z * 12.92);
}

// A picture that was composited in display colours, made ready to be laid over linear ones: emitted light and alpha, premultiplied.
// trained: display colour, premultiplied, and alpha; behind: linear light of what lies there, where that is known.
// Of a person over any background the display colour is trained.rgb + (1 - a) background; in linear light that is no "over", so the
// alpha is that of two backgrounds; the emitted light makes it exact for the background that is there.
float4 GsacOver(float4 trained, float3 behind, bool known)
{
    float left = 1 - trained.a;
    float3 low = GsacLinear(trained.rgb + left * GSAC_DARK_BEHIND);
    float3 high = GsacLinear(trained.rgb + left * GSAC_BRIGHT_BEHIND);
    float span = GsacLinear(GSAC_BRIGHT_BEHIND).x - GsacLinear(GSAC_DARK_BEHIND).x;
    // green has most of what an eye sees
    float through = (high.g - low.g) / span;
    float3 there = max(known ? behind : GsacLinear(GSAC_USUAL_BEHIND), 1e-6);
    float3 wanted = GsacLinear(trained.rgb + left * GsacDisplay(there));
    // emitted light is never negative
    float3 most = wanted / there;
    through = min(through, min(most.r, min(most.g, most.b)));
    return float4(max(wanted - through * there, 0), 1 - through);
}

#endif
