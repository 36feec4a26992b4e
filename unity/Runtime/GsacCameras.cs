using System;
using System.Collections.Generic;
using UnityEngine;
using UnityEngine.Rendering;

namespace Gsac
{
    /// <summary>
    /// Has the avatars drawn for each camera just before it culls, in every render pipeline: for the game's and the editor's
    /// cameras, for probes and recorders, and for a camera that a script renders by hand.
    /// </summary>
    public static class GsacCameras
    {
        static readonly List<GsacRenderer> Renderers = new List<GsacRenderer>();
        static readonly List<GsacView> Seen = new List<GsacView>();
        static readonly List<GsacCrowd> Crowds = new List<GsacCrowd>();
        static int[] group = new int[16], counts = new int[16]; // of each of Seen: the first whom it is drawn with; gaussians of a group
        static Material material, own, trained;
        static readonly Material[] body = new Material[2];

        /// <summary>
        /// Gaussians that a headset's camera draws at most, of all people together; 0: as many as there are. The farthest person gets
        /// coarser first; nobody vanishes.
        /// </summary>
        public static int MostInHeadset;

        /// <summary>Whether a camera shows an object of its layers; null: all do. The editor's prefab stages and hidden objects are told by it.</summary>
        public static Func<Camera, GameObject, bool> Shows;

        /// <summary>
        /// Whether HDRP copies, for a camera, what lies behind the transparent things; null: nobody knows. Gsac.HighDefinition tells; the
        /// other pipelines' shaders see it by themselves.
        /// </summary>
        public static Func<Camera, bool> CopiesBehind;

        /// <summary>The splats' material, shared by all avatars that have none of their own.</summary>
        public static Material Material
        {
            get { return Made(ref material, "Gsac/GsacSplats"); }
        }

        /// <summary>What draws an avatar's own picture, and what lays it over the scene.</summary>
        internal static Material OwnMaterial
        {
            get { return Made(ref own, "Gsac/GsacOwn"); }
        }

        internal static Material TrainedMaterial
        {
            get { return Made(ref trained, "Gsac/GsacTrained"); }
        }

        /// <summary>What the body's mesh wears: shadow, depth texture and motion; depth.</summary>
        internal static Material[] BodyMaterials
        {
            get
            {
                Made(ref body[0], "Gsac/GsacBody");
                Made(ref body[1], "Gsac/GsacBodyDepth");
                return body;
            }
        }

        /// <summary>Whether a material is the body's own, without making one.</summary>
        internal static bool IsOfBody(Material worn)
        {
            return ReferenceEquals(worn, body[0]);
        }

        static Material Made(ref Material material, string shader)
        {
            if (material == null) Make(ref material, shader);
            return material;
        }

        static void Make(ref Material material, string shader)
        {
            material = new Material(Resources.Load<Shader>(shader)) { hideFlags = HideFlags.HideAndDontSave };
        }

        internal static void Add(GsacRenderer renderer)
        {
            if (Renderers.Count == 0)
            {
                Camera.onPreCull += Draw;
                RenderPipelineManager.beginCameraRendering += Draw;
            }
            Renderers.Add(renderer);
        }

        internal static void Remove(GsacRenderer renderer)
        {
            if (!Renderers.Remove(renderer) || Renderers.Count > 0) return;
            Camera.onPreCull -= Draw;
            RenderPipelineManager.beginCameraRendering -= Draw;
            foreach (GsacCrowd crowd in Crowds) crowd.Dispose();
            Crowds.Clear();
            Seen.Clear();
            Free(material);
            Free(own);
            Free(trained);
            Free(body[0]);
            Free(body[1]);
            material = own = trained = body[0] = body[1] = null;
        }

        /// <summary>Destroys what was made at run time, or in the editor while nothing plays.</summary>
        internal static void Free(UnityEngine.Object made)
        {
            if (made == null) return;
            if (Application.isPlaying) UnityEngine.Object.Destroy(made);
            else UnityEngine.Object.DestroyImmediate(made);
        }

        static void Draw(ScriptableRenderContext context, Camera camera)
        {
            Draw(camera);
        }

        static void Draw(Camera camera)
        {
            Seen.Clear();
            for (int i = 0; i < Renderers.Count; i++)
            {
                GameObject person = Renderers[i].gameObject;
                if ((camera.cullingMask & (1 << person.layer)) == 0 || Shows != null && !Shows(camera, person)) continue;
                GsacView view = Renderers[i].See(camera);
                if (view != null) Seen.Add(view);
            }
            if (Seen.Count == 0) return;
            if (camera.stereoEnabled && MostInHeadset > 0) Coarsen();
            for (int i = 0; i < Seen.Count; i++) Seen[i].Renderer.Pose(Seen[i]);
            Gather();
            int crowds = 0;
            for (int i = 0; i < Seen.Count; i++)
            {
                if (group[i] != i) continue;
                if (counts[i] == Seen[i].Level.Count) Seen[i].Draw();
                else Crowd(camera, crowds++).Draw(Seen, group, i);
            }
        }

        /// <summary>Fills `group` and `counts`: who stands among each other is drawn together.</summary>
        static void Gather()
        {
            if (group.Length < Seen.Count) Grow(Seen.Count * 2);
            for (int i = 0; i < Seen.Count; i++)
            {
                group[i] = i;
                counts[i] = Seen[i].Level.Count;
                for (int j = 0; j < i; j++)
                {
                    int low = Math.Min(group[i], group[j]), high = Math.Max(group[i], group[j]);
                    if (low == high || counts[low] + counts[high] > GsacCrowd.Most || !GsacCrowd.Meet(Seen[i], Seen[j])) continue;
                    counts[low] += counts[high];
                    for (int k = 0; k <= i; k++) group[k] = group[k] == high ? low : group[k];
                }
            }
        }

        static void Grow(int most)
        {
            group = new int[most];
            counts = new int[most];
        }

        static void Coarsen()
        {
            int total = 0;
            for (int i = 0; i < Seen.Count; i++) total += Seen[i].Level.Count;
            while (total > MostInHeadset)
            {
                GsacView farthest = null;
                for (int i = 0; i < Seen.Count; i++)
                {
                    if (Seen[i].CanBeCoarser && (farthest == null || Seen[i].Nearest > farthest.Nearest)) farthest = Seen[i];
                }
                if (farthest == null) return;
                total -= farthest.Level.Count;
                farthest.Coarsen();
                total += farthest.Level.Count;
            }
        }

        /// <summary>The camera's crowd of that number.</summary>
        static GsacCrowd Crowd(Camera camera, int number)
        {
            for (int i = Crowds.Count - 1; i >= 0; i--)
            {
                if (Crowds[i].Camera != null) continue;
                Crowds[i].Dispose();
                Crowds.RemoveAt(i);
            }
            for (int i = 0; i < Crowds.Count; i++)
            {
                if (Crowds[i].Camera == camera && number-- == 0) return Crowds[i];
            }
            return NewCrowd(camera);
        }

        static GsacCrowd NewCrowd(Camera camera)
        {
            var crowd = new GsacCrowd(camera);
            Crowds.Add(crowd);
            return crowd;
        }
    }
}
