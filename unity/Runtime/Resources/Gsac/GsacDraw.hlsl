// Vertex and fragment work of a splat, for a wrapper that brings the pipeline's matrices and the eye.
#ifndef GSAC_DRAW_INCLUDED
#define GSAC_DRAW_INCLUDED

#include "GsacCore.hlsl"

StructuredBuffer<float4> GsacSplats;
StructuredBuffer<float4> GsacColours; // N: display colour, opacity
StructuredBuffer<uint> GsacKeys;

float4 GsacModel0; // rows of the avatar's own space -> world
float4 GsacModel1;
float4 GsacModel2;
float4 GsacBlend;  // px^2 added to the image covariance, most alpha, least alpha, 1 where the project blends linear colours
uint GsacKeepsEnergy; // 1: the low-pass spreads a gaussian's opacity over the area that it adds
uint GsacIndexBits;

struct GsacCorner
{
    float4 clip;
    float2 sigmas;
    float4 colour;
};

// What the projection makes of the eye's x and y: where in clip space they point (the picture may be turned or upside down), how long
// they are there, where the frustum's middle is; and whether all lines of sight run side by side.
struct GsacLens
{
    float2 right;
    float2 up;
    float2 size;
    float2 middle;
    bool flat;
};

GsacLens GsacLensOf(float4x4 projection)
{
    GsacLens lens;
    float2 right = float2(projection[0][0], projection[1][0]);
    float2 up = float2(projection[0][1], projection[1][1]);
    float2 shift = float2(projection[0][2], projection[1][2]);
    lens.size = float2(length(right), length(up));
    lens.right = right / lens.size.x;
    lens.up = up / lens.size.y;
    lens.middle = float2(dot(lens.right, shift), dot(lens.up, shift)) / lens.size;
    lens.flat = projection[3][3] > 0.5;
    return lens;
}

// The screen as the eye has it. Where the picture is turned by a right angle, some say its size before and some after: pixels are square.
float2 GsacUpright(float2 screen, GsacLens lens)
{
    float2 same = screen * lens.size;
    float2 other = screen.yx * lens.size;
    bool turned = abs(lens.right.x) < abs(lens.right.y);
    return turned && abs(other.x - other.y) < abs(same.x - same.y) ? screen.yx : screen;
}

// vertex: 4 a splat, from the farthest on; view: world (less `origin`) -> eye, -z ahead; screen: px.
GsacCorner GsacSplatCorner(uint vertex, float4x4 view, float4x4 projection, float2 screen, float3 origin)
{
    GsacCorner corner;
    corner.clip = float4(0, 0, 0, 1);
    corner.sigmas = float2(0, 0);
    uint splat = GsacKeys[vertex >> 2] & ((1u << GsacIndexBits) - 1);
    corner.colour = GsacColours[splat];
    float4 s0 = GsacSplats[splat * 3];
    float4 s1 = GsacSplats[splat * 3 + 1];
    float4 s2 = GsacSplats[splat * 3 + 2];
    corner.colour.rgb *= s2.yzw;

    float3 x = float3(GsacModel0.x, GsacModel1.x, GsacModel2.x);
    float3 y = float3(GsacModel0.y, GsacModel1.y, GsacModel2.y);
    float3 z = float3(GsacModel0.z, GsacModel1.z, GsacModel2.z);
    float3 world = x * s0.x + y * s0.y + z * s0.z + (float3(GsacModel0.w, GsacModel1.w, GsacModel2.w) - origin);
    float4 eye = mul(view, float4(world, 1));
    float depth = -eye.z;
    GsacLens lens = GsacLensOf(projection);
    // all corners in one place outside the view: nothing is drawn
    if (!(lens.flat || depth > GSAC_NEAR) || corner.colour.a < GsacBlend.z)
    {
        corner.clip = float4(2, 2, 2, 1);
        return corner;
    }
    float3 ex = mul(view, float4(x, 0)).xyz;
    float3 ey = mul(view, float4(y, 0)).xyz;
    float3 ez = mul(view, float4(z, 0)).xyz;
    screen = GsacUpright(screen, lens);
    // seen along the axis from a distance of 1, a flat picture's splat has its size everywhere
    float3 place = lens.flat ? float3(lens.middle, 1) : float3(eye.xy, depth);
    GsacEllipse e = GsacProject(float3(ex.x, ey.x, ez.x), float3(ex.y, ey.y, ez.y), -float3(ex.z, ey.z, ez.z),
                                place, float3(s0.w, s1.xy), float3(s1.zw, s2.x),
                                0.5 * screen * lens.size, lens.middle, 1 / lens.size, GsacBlend.x);
    if (GsacKeepsEnergy) corner.colour.a *= e.kept;
    float reach = GsacReach(corner.colour.a, GsacBlend.z);
    corner.sigmas = reach * float2((vertex & 1) ? 1.0 : -1.0, (vertex & 2) ? 1.0 : -1.0);
    float2 away = (corner.sigmas.x * e.large + corner.sigmas.y * e.small) * 2 / screen;
    corner.clip = mul(projection, float4(eye.xyz, 1));
    corner.clip.xy += (lens.right * away.x + lens.up * away.y) * corner.clip.w;
    if (GsacBlend.w > 0.5) corner.colour.rgb = GsacLinear(corner.colour.rgb);
    return corner;
}

float4 GsacPixel(float2 sigmas, float4 colour)
{
    return GsacShade(sigmas, colour, GsacBlend.yz);
}

#endif
