// The avatar's own picture: the gaussians composited in display colours, as they were trained, and their mean depth, m.
float4x4 GsacEyeView;       // world -> eye, -z ahead
float4x4 GsacEyeProjection; // to the picture: y as the graphics API has it in textures
float4 GsacEyeScreen;       // px of the picture; two numbers for GsacTrained.hlsl

#include "GsacDraw.hlsl"
#include "GsacFinish.hlsl"

struct GsacOwnVaryings
{
    float4 clip : SV_Position;
    float2 sigmas : TEXCOORD0;
    nointerpolation float4 colour : TEXCOORD1;
    nointerpolation float depth : TEXCOORD2; // m ahead of the eye
};

struct GsacOwnPixel
{
    float4 colour : SV_Target0;
    float4 depth : SV_Target1;
};

GsacOwnVaryings OwnVertex(uint vertex : SV_VertexID)
{
    GsacCorner corner = GsacSplatCorner(vertex, GsacEyeView, GsacEyeProjection, GsacEyeScreen.xy, float3(0, 0, 0));
    GsacOwnVaryings output;
    output.clip = corner.clip;
    output.sigmas = corner.sigmas;
    output.colour = corner.colour;
    // the tint is one of linear colours
    if (any(GsacTint.rgb != 1)) output.colour.rgb = GsacDisplay(GsacLinear(output.colour.rgb) * GsacTint.rgb);
    bool flat = GsacLensOf(GsacEyeProjection).flat;
    output.depth = flat ? (GsacEyeProjection[2][3] - corner.clip.z) / GsacEyeProjection[2][2] : corner.clip.w;
    return output;
}

GsacOwnPixel OwnFragment(GsacOwnVaryings input)
{
    GsacOwnPixel pixel;
    pixel.colour = GsacPixel(input.sigmas, input.colour);
    pixel.depth = float4(input.depth * pixel.colour.a, 0, 0, pixel.colour.a);
    return pixel;
}
