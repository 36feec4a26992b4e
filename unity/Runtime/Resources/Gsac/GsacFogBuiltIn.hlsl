// The built-in pipeline's fog, for GsacFinish.hlsl; after UnityCG.cginc.
#if defined(FOG_LINEAR) || defined(FOG_EXP) || defined(FOG_EXP2)
float3 GsacFogged(float3 colour, float z)
{
    UNITY_CALC_FOG_FACTOR_RAW(UNITY_Z_0_FAR_FROM_CLIPSPACE(z));
    return lerp(unity_FogColor.rgb, colour, saturate(unityFogFactor));
}
#define GSAC_FOGGED(colour, clip) GsacFogged(colour, (clip).z)
#endif
