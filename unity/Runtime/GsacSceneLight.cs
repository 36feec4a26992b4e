using System;
using UnityEngine;
using UnityEngine.Rendering;

namespace Gsac
{
    /// <summary>The light of the scene on one avatar: light probes or the ambient light, and the main light with the shadow in which the person stands.</summary>
    [Serializable]
    public sealed class GsacSceneLight
    {
        const float ShadowSeconds = 0.12f;
        const float FarthestShadow = 200; // m

        [Tooltip("0..1: how far the avatar stands in the scene's light instead of its clip's.")]
        public float Share;

        [Tooltip("Factor of the scene's light. In HDRP, whose lights are in lux: 1 over what lights a white wall well.")]
        public float Exposure = 1;

        [Tooltip("The main light; the scene's sun where this is empty.")]
        public Light Sun;

        [Tooltip("What throws shadows on the person: colliders of these layers.")]
        public LayerMask Shadows = Physics.DefaultRaycastLayers;

        static readonly RaycastHit[] Met = new RaycastHit[64]; // more than the person's own
        readonly GsacHarmonics light = new GsacHarmonics();
        readonly float[] turn = new float[9], rows = new float[28];
        float shade = -1; // 1: in the light, 0: in the shadow; -1: not known yet

        /// <summary>Fills seven rows, those of the scene's light in the avatar's own mirrored space, from `first` on.</summary>
        public void Fill(Transform root, Vector3 pelvis, Vector4[] all, int first)
        {
            float share = Mathf.Clamp(Share, 0, 1);
            if (share == 0) shade = -1;
            else Gather(root, pelvis, share);
            for (int i = 0; i < 7; i++)
            {
                all[first + i] = share == 0 ? new Vector4(0, 0, 0, 0) : new Vector4(rows[i * 4], rows[i * 4 + 1], rows[i * 4 + 2], rows[i * 4 + 3]);
            }
        }

        void Gather(Transform root, Vector3 pelvis, float share)
        {
            light.Clear();
            SphericalHarmonicsL2 probe;
            LightProbes.GetInterpolatedProbe(pelvis, null, out probe);
            for (int c = 0; c < 3; c++)
            {
                light.AddProbe(c, Exposure * probe[c, 0], Exposure * probe[c, 1], Exposure * probe[c, 2], Exposure * probe[c, 3],
                               Exposure * probe[c, 4], Exposure * probe[c, 5], Exposure * probe[c, 6], Exposure * probe[c, 7], Exposure * probe[c, 8]);
            }
            Light sun = Sun != null ? Sun : RenderSettings.sun;
            if (sun != null && sun.isActiveAndEnabled) Shine(sun, root, pelvis);
            // the mirrored faces' normals point inwards
            Matrix4x4 m = root.localToWorldMatrix;
            for (int i = 0; i < 3; i++)
            {
                Vector4 column = m.GetColumn(i);
                float size = -Mathf.Sqrt(column.x * column.x + column.y * column.y + column.z * column.z);
                turn[i] = column.x / size;
                turn[3 + i] = column.y / size;
                turn[6 + i] = column.z / size;
            }
            light.Rows(turn, share, rows);
        }

        /// <summary>Whether something stands between a place and the light: the person's own colliders do not count.</summary>
        bool IsShaded(Transform root, Vector3 place, Vector3 towardsLight)
        {
            int count = Physics.RaycastNonAlloc(place, towardsLight, Met, FarthestShadow, Shadows, QueryTriggerInteraction.Ignore);
            for (int i = 0; i < count; i++)
            {
                if (!Met[i].transform.IsChildOf(root)) return true;
            }
            return false;
        }

        void Shine(Light sun, Transform root, Vector3 pelvis)
        {
            Vector3 from = -sun.transform.forward;
            float lit = sun.shadows != LightShadows.None && IsShaded(root, pelvis, from) ? 0 : 1;
            // who steps into the shade grows darker, not black at once
            bool jump = shade < 0 || !Application.isPlaying;
            shade = jump ? lit : lit + (shade - lit) * Mathf.Exp(-Time.deltaTime / ShadowSeconds);
            if (Math.Abs(shade - lit) < 1e-3f) shade = lit;
            Color colour = sun.color.linear;
            float strength = Exposure * sun.intensity * shade;
            light.AddSun(0, strength * colour.r, from.x, from.y, from.z);
            light.AddSun(1, strength * colour.g, from.x, from.y, from.z);
            light.AddSun(2, strength * colour.b, from.x, from.y, from.z);
        }
    }
}
