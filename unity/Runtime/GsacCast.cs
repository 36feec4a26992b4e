using System;
using UnityEngine;

namespace Gsac
{
    /// <summary>Places people in rows: those named, or where none is, the people of the project, whom the editor finds.</summary>
    [AddComponentMenu("Gsac/Gsac Cast")]
    [DisallowMultipleComponent]
    [DefaultExecutionOrder(-9000)]
    [ExecuteAlways]
    public sealed class GsacCast : MonoBehaviour
    {
        /// <summary>Finds the people of the project; the editor gives it. Null in players, for which the editor has named the people.</summary>
        public static Func<GsacAvatar[]> FindPeople;

        [SerializeField, Tooltip("Prefabs, as imported .gsac files are. Where none is named: all of the project.")]
        GsacAvatar[] people = new GsacAvatar[0];

        [SerializeField, Tooltip("How many stand there; they take turns.")] int count = 1;
        [SerializeField, Tooltip("m between two of them")] float apart = 1.2f;

        GsacAvatar[] standing = new GsacAvatar[0];

        /// <summary>The prefabs that are named.</summary>
        public GsacAvatar[] People
        {
            get { return people; }
            set { people = value; }
        }

        /// <summary>Who stands there; empty where the project has nobody.</summary>
        public GsacAvatar[] Standing { get { return standing; } }

        /// <summary>Null where the project has nobody.</summary>
        public GsacAvatar First { get { return standing.Length == 0 ? null : standing[0]; } }

        void OnEnable()
        {
            // a prefab that was deleted leaves a gap
            GsacAvatar[] named = Array.FindAll(people, one => one != null);
            GsacAvatar[] prefabs = named.Length == 0 && FindPeople != null ? FindPeople() : named;
            if (prefabs.Length == 0)
            {
                Debug.LogWarning(name + ": nobody to show; drag an avatar.gsac into the Project window, then open this scene again", this);
                return;
            }
            standing = new GsacAvatar[Math.Max(count, 0)];
            int columns = (int)Math.Ceiling(Math.Sqrt(standing.Length));
            for (int i = 0; i < standing.Length; i++)
            {
                standing[i] = Instantiate(prefabs[i % prefabs.Length]);
                // what the scene shows while it is edited is not saved with it
                if (!Application.isPlaying) standing[i].gameObject.hideFlags = HideFlags.DontSave;
                standing[i].transform.SetParent(transform, false);
                standing[i].transform.localPosition = new Vector3((i % columns - (columns - 1) / 2f) * apart, 0, -(i / columns) * apart);
            }
        }

        void OnDisable()
        {
            foreach (GsacAvatar avatar in standing)
            {
                if (avatar == null) continue;
                if (Application.isPlaying) Destroy(avatar.gameObject);
                else DestroyImmediate(avatar.gameObject);
            }
            standing = new GsacAvatar[0];
        }
    }
}
