// Draws the gaussians into the avatar's own picture, composited in display colours, for GsacTrained.shader; in every render pipeline.
Shader "Hidden/Gsac/Own"
{
    SubShader
    {
        Pass
        {
            Name "Own"
            ZWrite Off
            ZTest Always
            Cull Off
            Blend One OneMinusSrcAlpha

            HLSLPROGRAM
            #pragma target 4.5
            #pragma vertex OwnVertex
            #pragma fragment OwnFragment
            #include "GsacOwn.hlsl"
            ENDHLSL
        }
    }
}
